//! The measured signals of a cell (the point on the specimen or arm along its axes, the spots next
//! to the contact if there are any, the load cells), and the cells of one impact: rows, frequency
//! lines and the parameters that they depend on.
//!
//! A point is either visited by the 3-D vibrometer or has a fixed sensor, for example a triaxial
//! accelerometer. The vibrometer's axes have one gain and delay each, whatever the point; a fixed
//! sensor has its own, and its axes may be tilted. Fixed sensors measure every hit at the same
//! time, so that several cells have the same hits: the signals that all cells contain (T and the
//! spots) count in the first of them only.

use super::parameters::{Cause, DELAYS, ELASTIC, FORM, GAINS, Parameter, Parameters, SPOTS, along_z};
use super::{ContactError, ContactPriors, Input};
use crate::band::Band;
use crate::frf::MotionQuantity;
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use crate::substructuring::geometry::Grouping;
use nalgebra::{Matrix6, SymmetricEigen, Vector3, Vector6};
use num_complex::Complex;
use std::collections::BTreeMap;

/// The body under a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Arm B.
    ArmB,
    /// Specimen A.
    SpecimenA,
    /// Specimen B, if it has points of its own.
    SpecimenB,
}

impl Group {
    fn of(grouping: Grouping) -> Option<Self> {
        match grouping {
            Grouping::InterfaceB => Some(Group::ArmB),
            Grouping::SpecimenA => Some(Group::SpecimenA),
            Grouping::SpecimenB => Some(Group::SpecimenB),
            _ => None,
        }
    }
}

/// One axis of the sensor at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Unit vector of its nominal direction.
    pub direction: [f64; 3],
    /// Index of its gain among the parameters.
    pub gain: usize,
    /// Index of its delay among the parameters.
    pub delay: usize,
    /// Index of its two sensitivities to motion across the direction, and the unit vectors of that
    /// motion; none if the direction is exact.
    pub across: Option<(usize, [[f64; 3]; 2])>,
}

/// One cell of a block.
#[derive(Debug, Clone)]
pub struct BlockCell {
    /// Name of its point.
    pub name: String,
    /// Number of its hits; none if it is only planned.
    pub hits: usize,
    /// The first cell of the block that has the same hits, if that is another one.
    pub first: Option<usize>,
    /// The body that its point is on.
    pub group: Group,
    /// The axes of its sensor: the channels from 3 on.
    pub axes: Vec<Axis>,
    /// Index of the point's first coordinate among the parameters.
    pub point: usize,
    /// If the vibrometers of the spots are aimed at this point: index of x and y of that of spot A
    /// relative to the point, then of spot B.
    pub lasers: Option<usize>,
    /// Index of the cell's own aim error (three parameters), if it has one.
    pub aim: Option<usize>,
    /// Index of the two aim errors of the hammer, if any.
    pub shift: Option<usize>,
    /// Fraction of the signal that the model does not explain, for load cells and spots and for the
    /// point: counted as noise proportional to the signal.
    pub unexplained: [f64; 2],
}

/// One row: a channel of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelRow {
    /// Index of the cell in the block.
    pub cell: usize,
    /// T is 0, spot B 1, spot A 2, the point's axes from 3 on.
    pub channel: usize,
}

/// One frequency line of a block.
#[derive(Debug, Clone)]
pub struct BlockLine {
    /// s = σ + i2πf, 1/s.
    pub s: Complex<f64>,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Values by row.
    pub value: Vec<Complex<f64>>,
    /// Standard deviation of the noise, by row.
    pub sigma: Vec<f64>,
    /// Reciprocal standard deviation of noise and unexplained signal together, by row.
    pub weight: Vec<f64>,
}

/// All cells of one impact.
#[derive(Debug, Clone)]
pub struct Block {
    /// The impact's name.
    pub impact: String,
    /// The body that it hits.
    pub grouping: Grouping,
    /// Position of the impact, m.
    pub at_m: [f64; 3],
    /// Unit vector of its direction.
    pub direction: [f64; 3],
    /// Whether the fit uses its signals. Not those of an impact whose cells were aimed one by one
    /// where nothing shows what the hammer's aim changes: their differences would be taken for the
    /// specimens' bending. Its motion is computed all the same.
    pub counts: bool,
    /// On B alone: index of the parameter for the z component of the hammer force.
    pub along_z: Option<usize>,
    /// The cells.
    pub cells: Vec<BlockCell>,
    /// The rows, one for each channel of each cell.
    pub rows: Vec<ChannelRow>,
    /// The lines that are usable in every channel of every cell.
    pub lines: Vec<BlockLine>,
    /// Other blocks and their weights: a shift of the impact by one metre along either of two axes
    /// adds this weighted sum of their motions.
    pub shifted_by: Vec<(usize, [f64; 2])>,
    /// The parameters that the block depends on.
    pub parameters: Vec<usize>,
    local: Vec<usize>,
    has_specimen_b: bool,
}

impl Block {
    /// Index of specimen B's first coordinate, if it has any.
    pub fn specimen_b(&self) -> Option<usize> {
        self.has_specimen_b.then_some(if self.along_z.is_some() { 6 } else { 12 })
    }

    /// Number of coordinates of the motion.
    pub fn latent(&self) -> usize {
        let own = if self.along_z.is_some() { 6 } else { 12 };
        if self.has_specimen_b { own + 6 } else { own }
    }

    /// Index of a parameter within the block.
    pub fn local(&self, parameter: usize) -> usize {
        self.local[parameter]
    }

    /// Lists the places of the block's parameters among all `count` parameters.
    fn index(&mut self, count: usize) {
        self.local = vec![usize::MAX; count];
        for (place, parameter) in self.parameters.iter().enumerate() {
            self.local[*parameter] = place;
        }
    }

    /// Changes the noise to that of more hits in a cell, and in those that have the same hits;
    /// The weights are not changed. Returns the changed cells.
    pub fn hit_again(&mut self, cell: usize, more: usize) -> Vec<usize> {
        let own: Vec<usize> = (0..self.cells.len())
            .filter(|other| *other == cell || self.cells[*other].first == Some(cell))
            .collect();
        for &at in &own {
            let hits = self.cells[at].hits;
            let left = hits.max(1) as f64 / (hits + more).max(1) as f64;
            for line in &mut self.lines {
                for (r, _) in self.rows.iter().enumerate().filter(|(_, row)| row.cell == at) {
                    let floor = floor(line.value[r]);
                    let noise = noise_power(line.sigma[r], line.value[r]);
                    line.sigma[r] = (left * noise + floor * floor).sqrt();
                }
            }
            self.cells[at].hits += more;
        }
        own
    }
}

/// A cell that has no hits yet, measured by the moving vibrometer.
#[derive(Debug, Clone, Copy)]
pub struct PlannedCell<'a> {
    /// The assembly AJB, or B alone.
    pub structure: Structure,
    /// The impact's name.
    pub impact: &'a str,
    /// The response point's name.
    pub point: &'a str,
    /// Position of the response point, m.
    pub point_m: [f64; 3],
    /// As in [`ContactCell`].
    pub point_sigma_m: Option<f64>,
    /// Grouping of the response point: arm B's interface, or a specimen.
    pub point_grouping: Grouping,
    /// The directions along which the point is measured.
    pub axes: Axes,
    /// As in [`ContactCell`].
    pub lasers: bool,
}

/// Adds a planned cell, without weight, to the block of its impact; returns the block and the
/// cell's index in it. Its noise is that of a cell of the block on the same body; `seen` predicts
/// the values of all rows of the block with this index at a line, with these parameters. `None` if
/// its impact has no block, or no cell of the block is like it.
pub(super) fn plan_cell(
    blocks: &mut [Block],
    planned: &PlannedCell<'_>,
    input: &Input<'_>,
    parameters: &mut Parameters,
    p: &mut Vec<f64>,
    seen: impl Fn(&Block, usize, usize, &[f64]) -> Vec<Complex<f64>>,
) -> Option<(usize, usize)> {
    let priors = &input.priors;
    let group = Group::of(planned.point_grouping)?;
    let alone = planned.structure == Structure::B;
    let b =
        blocks.iter().position(|block| block.along_z.is_some() == alone && block.impact == planned.impact)?;
    // specimen B's motion is part of the block only if its points were measured
    if (group == Group::SpecimenB && blocks[b].specimen_b().is_none()) || (group == Group::SpecimenA && alone)
    {
        return None;
    }
    let moving = |cell: &&BlockCell| cell.axes.iter().all(|axis| axis.across.is_none());
    let known = |cell: &&BlockCell| cell.name == planned.point && cell.group == group;
    let same = blocks.iter().flat_map(|block| &block.cells).filter(moving).find(known);
    let same = same.map(|cell| (cell.point, cell.axes.clone()));
    let (point, axes) = same.unwrap_or_else(|| {
        let (sigma, cause) = of_points(group, priors);
        let at = relative(planned.point_m, input.contact_m);
        let axes = axes(planned.point, planned.axes, false, priors, parameters);
        (position(planned.point, at, planned.point_sigma_m.unwrap_or(sigma), cause, parameters), axes)
    });
    let all = blocks.iter().flat_map(|block| &block.cells);
    let lasers = (planned.lasers && alone).then(|| {
        let known = all.filter(|cell| cell.name == planned.point).find_map(|cell| cell.lasers);
        known.unwrap_or_else(|| lasers(planned.point, priors, parameters))
    });
    let block = &blocks[b];
    let likes = |cell: &BlockCell| cell.group == group && cell.hits > 0 && cell.axes.len() == axes.len();
    let like = block.cells.iter().position(likes)?;
    let spots = if lasers.is_some() {
        vec![1, 2]
    } else {
        let usual = block.cells.iter().position(|cell| cell.lasers.is_none() && cell.first.is_none())?;
        let own = block.rows.iter().filter(|row| row.cell == usual && (1..POINT).contains(&row.channel));
        own.map(|row| row.channel).collect()
    };
    let channels: Vec<usize> = std::iter::once(0).chain(spots).chain(POINT..POINT + axes.len()).collect();
    // the noise of one hit: for load cells and spots from any cell, for the point from one like it
    let source = |channel: usize| {
        let fits = |row: &&ChannelRow| row.channel == channel && (channel < POINT || row.cell == like);
        let row = block.rows.iter().position(|row| fits(&row));
        // a vibrometer aimed elsewhere has the noise of the other one
        row.or_else(|| block.rows.iter().position(|row| (1..POINT).contains(&row.channel)))
    };
    let sources = channels.iter().map(|channel| source(*channel)).collect::<Option<Vec<usize>>>()?;
    let aim = priors.positions.aim_m;
    let named = |what: &str| {
        let name = format!("the {what}'s aim in {} × {}", planned.impact, planned.point);
        Parameter::new(name, 0.0, aim, Cause::Aim)
    };
    let aimed =
        (group == Group::ArmB && aim > 0.0).then(|| parameters.add((0..3).map(|_| named("vibrometer"))));
    let shift =
        (!block.shifted_by.is_empty() && aim > 0.0).then(|| parameters.add((0..2).map(|_| named("hammer"))));
    p.extend(parameters.all()[p.len()..].iter().map(|own| own.start));
    let count = p.len();

    let block = &mut blocks[b];
    let cell = block.cells.len();
    let unexplained = block.cells[like].unexplained;
    let own = (point..point + 3)
        .chain(lasers.into_iter().flat_map(|at| at..at + 4))
        .chain(axes.iter().flat_map(|axis| [axis.gain, axis.delay]))
        .chain(aimed.into_iter().flat_map(|at| at..at + 3))
        .chain(shift.into_iter().flat_map(|at| at..at + 2));
    block.parameters.extend(own);
    block.parameters.sort_unstable();
    block.parameters.dedup();
    let name = planned.point.to_owned();
    block.cells.push(BlockCell {
        name,
        hits: 0,
        first: None,
        group,
        axes,
        point,
        lasers,
        aim: aimed,
        shift,
        unexplained,
    });
    let before = block.rows.len();
    block.rows.extend(channels.iter().map(|channel| ChannelRow { cell, channel: *channel }));
    let noises: Vec<Vec<f64>> = (block.lines.iter())
        .map(|line| {
            let noise = |from: &usize| {
                let hits = block.cells[block.rows[*from].cell].hits as f64;
                hits * noise_power(line.sigma[*from], line.value[*from])
            };
            sources.iter().map(noise).collect()
        })
        .collect();
    for block in blocks.iter_mut() {
        block.index(count);
    }
    let values: Vec<Vec<Complex<f64>>> =
        (0..blocks[b].lines.len()).map(|line| seen(&blocks[b], b, line, p).split_off(before)).collect();
    for ((line, noises), values) in blocks[b].lines.iter_mut().zip(noises).zip(values) {
        let sigma = noises.iter().zip(&values).map(|(noise, value)| (noise + floor(*value).powi(2)).sqrt());
        line.sigma.extend(sigma);
        line.weight.extend(values.iter().map(|_| 0.0));
        line.value.extend(values);
    }
    Some((b, cell))
}

/// The part of a signal that counts as noise whatever its noise is.
fn floor(value: Complex<f64>) -> f64 {
    RELATIVE_FLOOR * value.norm()
}

/// The variance that more hits average, of a signal with this standard deviation.
fn noise_power(sigma: f64, value: Complex<f64>) -> f64 {
    (sigma * sigma - floor(value).powi(2)).max(0.0)
}

/// Position, direction and cells of one impact.
struct Impact<'a> {
    structure: Structure,
    name: &'a str,
    at_m: [f64; 3],
    direction: [f64; 3],
    grouping: Grouping,
    cells: Vec<(Group, &'a ContactCell<'a>)>,
}

impl Impact<'_> {
    /// Whether points on specimen B are measured.
    fn shows_specimen_b(&self) -> bool {
        self.cells.iter().any(|(group, _)| *group == Group::SpecimenB)
    }
}

/// Groups the cells by impact and adds their unknowns to the parameters.
///
/// # Errors
/// The measured cells do not determine the motion of arm B and specimen A.
pub fn blocks(input: &Input<'_>, parameters: &mut Parameters) -> Result<Vec<Block>, ContactError> {
    let impacts = impacts(input);
    let chosen = chosen_lines(input)?;
    let mut points: BTreeMap<(Group, &str), MeasuredPoint> = BTreeMap::new();
    for impact in &impacts {
        for (group, cell) in &impact.cells {
            points.entry((*group, cell.point)).or_insert_with(|| {
                let (sigma, cause) = of_points(*group, &input.priors);
                let sigma = cell.point_sigma_m.unwrap_or(sigma);
                let at = relative(cell.point_m, input.contact_m);
                let axes = axes(cell.point, cell.axes, cell.fixed, &input.priors, parameters);
                let position = position(cell.point, at, sigma, cause, parameters);
                let lasers = (cell.lasers && impact.structure == Structure::B)
                    .then(|| lasers(cell.point, &input.priors, parameters));
                MeasuredPoint { position, axes, lasers }
            });
        }
    }
    let mut all = Vec::new();
    for impact in &impacts {
        all.push(block(impact, &impacts, &points, input, &chosen, parameters)?);
    }
    count_known_aims(&mut all, input.priors.positions.aim_m);
    // a shift of one impact is formed from the motion of other impacts, line by line
    let everywhere: Vec<Vec<f64>> =
        all.iter().map(|block| block.lines.iter().map(|line| line.frequency_hz).collect()).collect();
    for block in &mut all {
        block.lines.retain(|line| {
            let has = |own: &Vec<f64>| own.binary_search_by(|f| f.total_cmp(&line.frequency_hz)).is_ok();
            everywhere.iter().all(has)
        });
    }
    let count = parameters.all().len();
    for block in &mut all {
        block.index(count);
    }
    Ok(all)
}

/// Decides which blocks of the assembly count. On entry [`Block::counts`] says whether impacts on
/// the same body show what a shift of the impact changes. Without any error of aim, or with all
/// signals from the same hits, it does not matter; where no block would count, all do.
fn count_known_aims(blocks: &mut [Block], aim_m: f64) {
    for block in blocks.iter_mut() {
        let same_hits = block.cells.iter().skip(1).all(|cell| cell.first.is_some());
        block.counts |= block.along_z.is_some() || same_hits || aim_m == 0.0;
    }
    let assembled = |block: &Block| block.along_z.is_none();
    if !blocks.iter().any(|block| assembled(block) && block.counts) {
        for block in blocks {
            block.counts = true;
        }
    }
}

/// Standard deviation of the position of a body's points, m, and its cause.
fn of_points(group: Group, priors: &ContactPriors) -> (f64, Cause) {
    match group {
        Group::ArmB => (priors.positions.position_m, Cause::ArmPoints),
        _ => (priors.specimen_point_m, Cause::SpecimenPoints),
    }
}

/// Adds the coordinates of a point; returns the index of the first.
fn position(point: &str, at: [f64; 3], sigma: f64, cause: Cause, parameters: &mut Parameters) -> usize {
    let own = |(axis, start)| Parameter::new(format!("{axis} of point {point}"), start, sigma, cause);
    parameters.add(["x", "y", "z"].into_iter().zip(at).map(own))
}

/// Adds the aims of the vibrometers of both spots at a point; returns the index of the first.
fn lasers(point: &str, priors: &ContactPriors, parameters: &mut Parameters) -> usize {
    let aim = |laser: &str, axis: &str| {
        let name = format!("{axis} of the aim of spot {laser}'s vibrometer at {point}");
        Parameter::new(name, 0.0, priors.positions.aim_m, Cause::Aim)
    };
    parameters.add(["A", "B"].into_iter().flat_map(|of| [aim(of, "x"), aim(of, "y")]))
}

/// A point, which several impacts may measure.
#[derive(Debug, Clone)]
struct MeasuredPoint {
    /// Index of its first coordinate among the parameters.
    position: usize,
    /// The axes of its sensor.
    axes: Vec<Axis>,
    /// As in [`BlockCell::lasers`], on B alone.
    lasers: Option<usize>,
}

/// The axes of a cell's sensor, with the parameters of a fixed one.
fn axes(
    point: &str,
    axes: Axes,
    fixed: bool,
    priors: &ContactPriors,
    parameters: &mut Parameters,
) -> Vec<Axis> {
    let own = |(place, direction): (usize, &[f64; 3])| {
        let direction = *direction;
        if !fixed {
            return Axis { direction, gain: GAINS + 2 + place, delay: DELAYS + 2 + place, across: None };
        }
        let name = |what: &str| format!("{what} of axis {} of the sensor at {point}", place + 1);
        let gain = parameters.add([
            Parameter::new(name("gain"), 0.0, priors.gain, Cause::Gains),
            Parameter::new(name("delay"), 0.0, priors.skew_s, Cause::Skew),
        ]);
        let turned = (priors.transverse > 0.0).then(|| {
            let across = ["first", "second"].map(|which| {
                let what = format!("{which} transverse sensitivity");
                Parameter::new(name(&what), 0.0, priors.transverse, Cause::SensorAxes)
            });
            (parameters.add(across), perpendicular(direction))
        });
        Axis { direction, gain, delay: gain + 1, across: turned }
    };
    axes.directions().iter().enumerate().map(own).collect()
}

/// Two unit vectors at right angles to a unit vector and to each other.
fn perpendicular(direction: [f64; 3]) -> [[f64; 3]; 2] {
    let own = Vector3::from(direction);
    let first = own.cross(&Vector3::ith(own.iamin(), 1.0)).normalize();
    [first.into(), own.cross(&first).into()]
}

/// Smallest eigenvalue of a body's normalised 6 × 6 matrix of sensors relative to the largest:
/// below this, the sensors leave one motion of the body undetermined.
const DETERMINED: f64 = 2e-3;

/// Whether sensors with these positions and unit directions determine all six motions of a rigid
/// body. Two triaxial sensors do not: a rotation about the line through them moves neither.
pub fn determines_motion(sensors: &[([f64; 3], [f64; 3])]) -> bool {
    let count = sensors.len().max(1) as f64;
    let at = |sensor: &([f64; 3], [f64; 3])| Vector3::from(sensor.0);
    let centre = sensors.iter().map(at).sum::<Vector3<f64>>() / count;
    let lever_m = (sensors.iter().map(|own| (at(own) - centre).norm_squared()).sum::<f64>() / count).sqrt();
    if lever_m <= 0.0 {
        return false;
    }
    let row = |sensor: &([f64; 3], [f64; 3])| {
        let (d, r) = (Vector3::from(sensor.1), (at(sensor) - centre) / lever_m);
        let turn = r.cross(&d);
        Vector6::new(d.x, d.y, d.z, turn.x, turn.y, turn.z)
    };
    let gram: Matrix6<f64> = sensors.iter().map(row).map(|row| row * row.transpose()).sum();
    let eigenvalues = SymmetricEigen::new(gram).eigenvalues;
    eigenvalues.min() > DETERMINED * eigenvalues.max()
}

fn relative(at: [f64; 3], origin: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| at[axis] - origin[axis])
}

/// The usable impacts, those on B alone first; cells of other points are left out.
fn impacts<'a>(input: &'a Input<'a>) -> Vec<Impact<'a>> {
    let mut found: Vec<Impact<'a>> = Vec::new();
    for structure in [Structure::B, Structure::Ajb] {
        for cell in input.cells.iter().filter(|cell| cell.structure == structure) {
            let Some(group) = Group::of(cell.point_grouping) else { continue };
            let hits_b = matches!(cell.impact_grouping, Grouping::InterfaceB | Grouping::InternalB);
            if hits_b != (structure == Structure::B)
                || (structure == Structure::B && group == Group::SpecimenA)
            {
                continue;
            }
            let place = found.iter().position(|i| i.structure == structure && i.name == cell.impact);
            let place = place.unwrap_or_else(|| {
                found.push(Impact {
                    structure,
                    name: cell.impact,
                    at_m: cell.impact_m,
                    direction: cell.direction,
                    grouping: cell.impact_grouping,
                    cells: Vec::new(),
                });
                found.len() - 1
            });
            found[place].cells.push((group, cell));
        }
    }
    let specimen_b = found.iter().any(Impact::shows_specimen_b);
    found.retain(|impact| {
        let known = |of: Group| {
            let own = impact.cells.iter().filter(|(group, _)| *group == of);
            let sensors = own.flat_map(|(_, cell)| {
                cell.axes.directions().iter().map(|direction| (cell.point_m, *direction))
            });
            determines_motion(&sensors.collect::<Vec<_>>())
        };
        known(Group::ArmB)
            && (impact.structure == Structure::B || known(Group::SpecimenA))
            // on B alone its specimen carries no force and moves with the arm
            && (!specimen_b
                || known(Group::SpecimenB)
                || (impact.structure == Structure::B && !impact.shows_specimen_b()))
    });
    found
}

/// The lines of the band, spaced so that the window leaves them nearly independent.
fn chosen_lines(input: &Input<'_>) -> Result<Vec<usize>, ContactError> {
    let first = input.cells.first().ok_or(ContactError::NoCells)?;
    let frequency_hz = first.spectra.frequency_hz();
    if let Some(other) = input.cells.iter().find(|c| c.spectra.frequency_hz() != frequency_hz) {
        return Err(ContactError::Unlike { impact: other.impact.into(), point: other.point.into() });
    }
    let step_hz = frequency_hz.windows(2).map(|f| f[1] - f[0]).next().unwrap_or(1.0);
    let stride = ((LINE_DISTANCE * first.spectra.sigma_per_s() / step_hz).round() as usize).max(1);
    let inside = (0..frequency_hz.len()).filter(|l| input.band_hz.contains(frequency_hz[*l]));
    Ok(inside.step_by(stride).collect())
}

/// Spacing of the lines used, divided by the window's σ, Hz s: closer lines only repeat the
/// information of their neighbours.
const LINE_DISTANCE: f64 = 0.4;

fn block(
    impact: &Impact<'_>,
    impacts: &[Impact<'_>],
    points: &BTreeMap<(Group, &str), MeasuredPoint>,
    input: &Input<'_>,
    chosen: &[usize],
    parameters: &mut Parameters,
) -> Result<Block, ContactError> {
    let priors = &input.priors;
    let alone = impact.structure == Structure::B;
    let mut own: Vec<usize> = if alone { (FORM..ELASTIC).collect() } else { (0..SPOTS).collect() };
    own.extend(SPOTS..SPOTS + 4);
    own.extend(GAINS..GAINS + 5);
    own.extend(DELAYS..DELAYS + 5);
    let along_z = alone
        .then(|| parameters.add([along_z(impact.name, impact.direction, priors.positions.hammer_angle_rad)]));
    own.extend(along_z);
    let (shifted_by, aim_known) = shifted_by(impact, impacts);
    let spots = if !alone {
        1..3
    } else if impacts.iter().any(Impact::shows_specimen_b) && !impact.shows_specimen_b() {
        // the spot is on specimen B, whose motion arm B's points do not give where the arm bends
        0..0
    } else {
        1..2
    };
    let (mut cells, mut rows, mut lines) = (Vec::new(), Vec::new(), Vec::<CellValues>::new());
    for (place, (group, cell)) in impact.cells.iter().enumerate() {
        let MeasuredPoint { position: point, axes, lasers } = points[&(*group, cell.point)].clone();
        let lasers = lasers.filter(|_| alone);
        own.extend(point..point + 3);
        own.extend(lasers.into_iter().flat_map(|at| at..at + 4));
        own.extend(axes.iter().flat_map(|axis| [axis.gain, axis.delay]));
        own.extend(axes.iter().filter_map(|axis| axis.across).flat_map(|(at, _)| at..at + 2));
        // the first cell with the same hits
        let same = |(_, other): &(Group, &ContactCell<'_>)| {
            other.records.iter().any(|record| cell.records.contains(record))
        };
        let first = impact.cells[..place].iter().position(same);
        let aimed = *group == Group::ArmB && !cell.fixed && priors.positions.aim_m > 0.0;
        let shifts = !shifted_by.is_empty() && priors.positions.aim_m > 0.0;
        let aim = |what: &str| {
            let name = format!("the {what}'s aim in {} × {}", impact.name, cell.point);
            Parameter::new(name, 0.0, priors.positions.aim_m, Cause::Aim)
        };
        let aimed = aimed.then(|| parameters.add((0..3).map(|_| aim("vibrometer"))));
        let shift = match first {
            // one hit has one place
            Some(first) => cells.get(first).and_then(|cell: &BlockCell| cell.shift),
            None => shifts.then(|| parameters.add((0..2).map(|_| aim("hammer")))),
        };
        own.extend(aimed.into_iter().flat_map(|at| at..at + 3));
        own.extend(shift.into_iter().flat_map(|at| at..at + 2));
        let spots = match lasers {
            _ if !cell.has_spots() || first.is_some() => 0..0,
            Some(_) => 1..3,
            None => spots.clone(),
        };
        let of_all = (first.is_none()).then_some(0).into_iter().chain(spots);
        let channels = of_all.chain(POINT..POINT + axes.len());
        rows.extend(channels.map(|channel| ChannelRow { cell: place, channel }));
        let (group, unexplained) = (*group, [0.0; 2]);
        let (name, hits) = (cell.point.to_owned(), cell.spectra.hits());
        cells.push(BlockCell {
            name,
            hits,
            first,
            group,
            axes,
            point,
            lasers,
            aim: aimed,
            shift,
            unexplained,
        });
        lines.push(cell_values(cell, chosen, input.band_hz)?);
    }
    pool_lines(&mut lines).ok_or_else(|| ContactError::SingleHits { impact: impact.name.into() })?;
    own.sort_unstable();
    own.dedup();
    let spectra = impact.cells[0].1.spectra;
    let line = |(place, l): (usize, &usize)| {
        let s = spectra.s(*l);
        let usable = rows.iter().all(|row| lines[row.cell].usable(place, row.channel, s));
        usable.then(|| {
            let sigma: Vec<f64> =
                rows.iter().map(|row| lines[row.cell].sigma(place, row.channel, s)).collect();
            BlockLine {
                s,
                frequency_hz: spectra.frequency_hz()[*l],
                value: rows.iter().map(|row| lines[row.cell].value[place][row.channel]).collect(),
                weight: sigma.iter().map(|sigma| sigma.recip()).collect(),
                sigma,
            }
        })
    };
    Ok(Block {
        impact: impact.name.to_owned(),
        counts: aim_known,
        grouping: impact.grouping,
        at_m: impact.at_m,
        direction: impact.direction,
        along_z,
        lines: chosen.iter().enumerate().filter_map(line).collect(),
        cells,
        rows,
        shifted_by,
        parameters: own,
        local: Vec::new(),
        has_specimen_b: impact.shows_specimen_b(),
    })
}

/// The motion that a shift of the impact adds, from the differences between impacts of the same
/// direction: a shift across the direction is a moment on the same body, and so are those
/// differences. Impacts on the same body are used if there are three, otherwise all impacts on the
/// same structure. The list is empty if no three of them span both axes. The flag states whether
/// they are on the same body.
fn shifted_by(impact: &Impact<'_>, impacts: &[Impact<'_>]) -> (Vec<(usize, [f64; 2])>, bool) {
    let parallel = |other: &Impact<'_>| {
        let cosine: f64 = (0..3).map(|i| other.direction[i] * impact.direction[i]).sum();
        other.structure == impact.structure && cosine.abs() > 0.99
    };
    let candidates: Vec<usize> = (0..impacts.len()).filter(|i| parallel(&impacts[*i])).collect();
    let same: Vec<usize> =
        candidates.iter().copied().filter(|i| impacts[*i].grouping == impact.grouping).collect();
    let mut across: Vec<usize> = (0..3).collect();
    across.sort_by(|a, b| impact.direction[*a].abs().total_cmp(&impact.direction[*b].abs()));
    let weights = |chosen: &[usize]| -> Option<Vec<(usize, [f64; 2])>> {
        if chosen.len() < 3 {
            return None;
        }
        let mean: [f64; 2] = std::array::from_fn(|k| {
            chosen.iter().map(|i| impacts[*i].at_m[across[k]]).sum::<f64>() / chosen.len() as f64
        });
        let at = |i: usize| [0, 1].map(|k| impacts[i].at_m[across[k]] - mean[k]);
        let product = |a: usize, b: usize| chosen.iter().map(|i| at(*i)[a] * at(*i)[b]).sum::<f64>();
        let (xx, xy, yy) = (product(0, 0), product(0, 1), product(1, 1));
        let determinant = xx * yy - xy * xy;
        // squared correlation above 0.99: the impacts lie almost on a line and determine no second
        // axis
        if determinant <= 1e-2 * xx * yy || determinant == 0.0 {
            return None;
        }
        let sense = |i: usize| -> f64 { (0..3).map(|a| impacts[i].direction[a] * impact.direction[a]).sum() };
        let weight = |i: usize| {
            let [x, y] = at(i);
            let of = [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant];
            (i, of.map(|w| w * sense(i).signum()))
        };
        Some(chosen.iter().map(|i| weight(*i)).collect())
    };
    match weights(&same) {
        Some(own) => (own, true),
        None => (weights(&candidates).unwrap_or_default(), false),
    }
}

/// Relative accuracy assumed for any signal, whatever its noise: it covers windows, interpolated
/// delays and the ringing of the force cell.
const RELATIVE_FLOOR: f64 = 5e-4;

/// The kept hits of one impact with one response point.
#[derive(Debug, Clone, Copy)]
pub struct ContactCell<'a> {
    /// The assembly AJB, or B alone.
    pub structure: Structure,
    /// The impact's name.
    pub impact: &'a str,
    /// Position of the impact, m.
    pub impact_m: [f64; 3],
    /// Unit vector of the hammer's push.
    pub direction: [f64; 3],
    /// Grouping of the impact's point: impacts of one grouping are on one body.
    pub impact_grouping: Grouping,
    /// The response point's name.
    pub point: &'a str,
    /// Position of the response point, m.
    pub point_m: [f64; 3],
    /// Standard deviation of that position along each axis, m; none if [`super::ContactPriors`]
    /// give it for this kind of point.
    pub point_sigma_m: Option<f64>,
    /// Grouping of the response point: arm B's interface, or a specimen.
    pub point_grouping: Grouping,
    /// The directions along which the point is measured.
    pub axes: Axes,
    /// Whether a sensor is fixed to the point, with its own gains and delays; otherwise the 3-D
    /// vibrometer visits it.
    pub fixed: bool,
    /// Whether on B alone the vibrometers of the spots are aimed at the point too, which compares
    /// their gains with the 3-D vibrometer's.
    pub lasers: bool,
    /// The records averaged: cells of one impact that share a record have the same hits.
    pub records: &'a [i64],
    /// The point's motion along its axes, then the velocity of the spots on A and B along z (m/s)
    /// if the rig has them, then the load cells' sum (N), with an exponential window of about
    /// [`SIGMA_PER_S`].
    pub spectra: &'a CrossSpectra,
    /// The physical quantity of the point's motion.
    pub quantity: MotionQuantity,
}

impl ContactCell<'_> {
    /// Whether its spectra contain the spots next to the contact.
    pub fn has_spots(&self) -> bool {
        self.spectra.outputs() == self.axes.directions().len() + 3
    }
}

/// One to three measured directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    directions: [[f64; 3]; 3],
    count: usize,
}

impl Axes {
    /// x, y and z.
    pub const XYZ: Self = Axes { directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], count: 3 };

    /// From unit vectors; `None` if there are none or more than three.
    pub fn new(directions: &[[f64; 3]]) -> Option<Self> {
        let mut all = [[0.0; 3]; 3];
        all.get_mut(..directions.len())?.copy_from_slice(directions);
        (!directions.is_empty()).then_some(Axes { directions: all, count: directions.len() })
    }

    /// The unit vectors.
    pub fn directions(&self) -> &[[f64; 3]] {
        &self.directions[..self.count]
    }
}

/// Damping of the exponential window that suits the contact best, 1/s.
///
/// All relations used here hold at every complex s. Heavy damping uses only the first part of the
/// response after the hit, where the signals are strong. At 2.3 /s, which FBS needs for its lightly
/// damped modes, most of a line is noise, and the noise in the signals that the force is computed
/// from biases the fit.
pub const SIGMA_PER_S: f64 = 50.0;

/// Index of a point's first axis among a cell's channels, after T, spot B and spot A.
pub(super) const POINT: usize = 3;

/// A cell's values, per newton of the hammer: motion as displacement (m/N), force in N/N; by
/// channel (T, spot B, spot A, then the point's axes). Those of absent spots are not numbers.
#[derive(Debug, Clone)]
pub(super) struct CellValues {
    /// By line and channel.
    pub value: Vec<Vec<Complex<f64>>>,
    /// Mean auto-spectrum of the force, by line (N² s²).
    pub force: Vec<f64>,
    /// Order of differentiation of each channel as it was measured.
    pub order: Vec<i32>,
    /// Noise power of each channel as measured: the signal's variance per hit, (own unit × s)².
    pub noise: Vec<f64>,
    /// Kept hits.
    pub hits: usize,
}

/// The cell's values at some of its lines. The noise is taken as white over `band_hz`, because a
/// single line of a few hits hardly determines its noise.
///
/// # Errors
/// The spectra do not have one output for each axis, T, and perhaps the two spots, or have other
/// lines.
pub(super) fn cell_values(
    cell: &ContactCell<'_>,
    chosen: &[usize],
    band_hz: Band,
) -> Result<CellValues, ContactError> {
    let spectra = cell.spectra;
    let axes = cell.axes.directions().len();
    let outputs: Vec<Option<usize>> = match spectra.outputs() {
        n if n == axes + 1 => [Some(axes), None, None].into_iter().chain((0..axes).map(Some)).collect(),
        n if n == axes + 3 => [axes + 2, axes + 1, axes].into_iter().chain(0..axes).map(Some).collect(),
        _ => Vec::new(),
    };
    if outputs.is_empty() || chosen.iter().any(|l| *l >= spectra.lines()) {
        return Err(ContactError::Unlike { impact: cell.impact.into(), point: cell.point.into() });
    }
    let response = cell.quantity.order_of_s();
    let order: Vec<i32> = [0, 1, 1].into_iter().chain(std::iter::repeat_n(response, axes)).collect();
    let inside: Vec<usize> =
        (0..spectra.lines()).filter(|l| band_hz.contains(spectra.frequency_hz()[*l])).collect();
    let hits = spectra.hits() as f64;
    let noise = |output: &Option<usize>| {
        // a single hit does not determine its noise
        let Some(output) = output.filter(|_| spectra.hits() >= 2) else { return f64::NAN };
        // of both parts, of one hit; the textbook formula divides by n where n − 1 is unbiased
        let scale = 2.0 * hits * hits / (hits - 1.0);
        let power = |l: &usize| spectra.variance(*l, output) * spectra.force(*l) * scale;
        inside.iter().map(power).sum::<f64>() / inside.len() as f64
    };
    let line = |&l: &usize| {
        let value = |(output, order): (&Option<usize>, &i32)| {
            output.map_or(Complex::from(f64::NAN), |output| spectra.h1(l, output) / spectra.s(l).powi(*order))
        };
        outputs.iter().zip(&order).map(value).collect()
    };
    Ok(CellValues {
        value: chosen.iter().map(line).collect(),
        force: chosen.iter().map(|l| spectra.force(*l)).collect(),
        noise: outputs.iter().map(noise).collect(),
        order,
        hits: spectra.hits(),
    })
}

/// Averages the noise over channels that share an instrument and its distance: the spots and the
/// load cells over all cells of an impact, the axes of the sensor within each cell. A cell with a
/// single hit has no noise estimate, so its point gets the mean noise of the impact's other points.
/// None if no cell has two hits.
pub(super) fn pool_lines(cells: &mut [CellValues]) -> Option<()> {
    let mean_of = |noises: &mut dyn Iterator<Item = f64>| {
        let known: Vec<f64> = noises.filter(|noise| noise.is_finite()).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    };
    for cell in cells.iter_mut() {
        let axes = &mut cell.noise[POINT..];
        let mean = axes.iter().sum::<f64>() / axes.len() as f64;
        axes.fill(mean);
    }
    for channel in 0..POINT {
        match mean_of(&mut cells.iter().map(|cell| cell.noise[channel])) {
            Some(mean) => cells.iter_mut().for_each(|cell| cell.noise[channel] = mean),
            None if channel == 0 => return None,
            None => {}
        }
    }
    let of_points = mean_of(&mut cells.iter().map(|cell| cell.noise[POINT]))?;
    for cell in cells.iter_mut().filter(|cell| !cell.noise[POINT].is_finite()) {
        cell.noise[POINT..].fill(of_points);
    }
    Some(())
}

impl CellValues {
    /// Standard deviation of a channel's complex noise at a line.
    pub fn sigma(&self, line: usize, channel: usize, s: Complex<f64>) -> f64 {
        let power = self.noise[channel] / (self.force[line] * self.hits as f64);
        let noise = power / s.norm_sqr().powi(self.order[channel]);
        (noise + floor(self.value[line][channel]).powi(2)).sqrt()
    }

    /// Whether a channel has a finite value and a known noise at a line.
    pub fn usable(&self, line: usize, channel: usize, s: Complex<f64>) -> bool {
        let sigma = self.sigma(line, channel, s);
        self.value[line][channel].is_finite() && sigma.is_finite() && sigma > 0.0
    }
}
