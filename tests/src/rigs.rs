//! Randomly drawn rigs, for which nothing was tuned: all parameters of the default rig are varied
//! simultaneously.

use jointrig::campaign::plan::CONTACT_BY_HAND;
use jointrig::contact::ContactPriors;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_hil_sim::rig::config::{Beam, Bushing, ContactLaw, Errors};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;

/// Parameters of the draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Largest k_T, N/m; the smallest is 60 N/µm.
    pub stiffest_n_per_m: f64,
    /// Factor of the default errors of position, angle, skew and cross-talk.
    pub errors: f64,
    /// Standard deviation of the gain of each load cell, each vibrometer and the hammer, relative.
    pub gain: f64,
    /// μN, N: contacts of even number slip as a whole beyond it (Jenkins), those of odd number have
    /// microslip below it (Iwan). `None`: no slip.
    pub slip_limit_n: Option<f64>,
    /// Whether the rig has the accelerometers of `accelerometers.toml` and a person who strikes,
    /// instead of lasers and a coil. Such rigs have a rigid clamp on side B: its front end has no
    /// channels for sensors on both arm and specimen.
    pub accelerometers: bool,
    /// Which bodies bend; `None`: all are rigid.
    pub elastic: Option<Elastic>,
}

/// Which bodies of a drawn rig bend, in addition to its specimens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elastic {
    /// Only the specimens.
    Specimens,
    /// Also the arms.
    SpecimensAndArms,
}

impl Default for Drawn {
    /// Contacts up to 300 N/µm that stick, with the default errors.
    fn default() -> Self {
        Drawn {
            stiffest_n_per_m: 300e6,
            errors: 1.0,
            gain: 0.005,
            slip_limit_n: None,
            accelerometers: false,
            elastic: None,
        }
    }
}

/// The rig with this number. A third of the rigs also have a clamp on side B.
///
/// Contacts of 60 N/µm and more, clamps × 0.3…3, local yaw modes at about 100…350 Hz, arms × 0.6…2,
/// rods, load cells, suspensions, damping, and floors × 0.3…3: each drawn independently.
pub fn drawn(number: u64, drawn: Drawn) -> RigConfig {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(0x0071_0000 + number);
    let mut between = |low: f64, high: f64| -> f64 {
        let u: f64 = random.random();
        low * (high / low).powf(u)
    };
    let mut rig = RigConfig { name: format!("drawn-{number}"), ..RigConfig::default() };

    let k = between(60e6, drawn.stiffest_n_per_m);
    rig.contact.stiffness_n_per_m = [k * between(0.7, 1.4), k * between(1.0, 2.0), k];
    rig.contact.rotation_nm_per_rad =
        [22.0 * between(0.5, 2.0), 10.0 * between(0.3, 2.0), 22.0 * between(0.5, 2.0)];
    rig.contact.damping_s = [1.5e-5 * between(0.4, 2.5); 6];

    if let Some(limit_n) = drawn.slip_limit_n {
        rig.contact.law = if number.is_multiple_of(2) { ContactLaw::Jenkins } else { ContactLaw::Iwan };
        rig.contact.normal_load_n = limit_n / rig.contact.friction_coefficient;
        // the default of 2 µs is too long for the stiffest contacts on the lightest specimens
        rig.contact.slip_step_s = 1e-6;
    }

    let mut clamp = |bushing: &mut Bushing, sign: f64, yaw: [f64; 2]| {
        let all = between(0.3, 3.0);
        scale(bushing, all);
        bushing.rotation_nm_per_rad[1] = 4.95 * between(yaw[0], yaw[1]);
        bushing.position_m =
            [1e-3 * between(0.1, 1.0), sign * 0.01 * between(0.7, 1.4), 1e-3 * between(0.1, 1.5)];
    };
    clamp(&mut rig.clamp.loaded, 1.0, [0.3, 6.0]);
    if number.is_multiple_of(3) {
        rig.clamp_b.rigid = false;
        clamp(&mut rig.clamp_b.loaded, -1.0, [2.0, 20.0]);
    }
    for specimen in [&mut rig.bodies.specimen_a, &mut rig.bodies.specimen_b] {
        let factor = between(0.7, 1.5);
        specimen.mass_kg *= factor;
        specimen.inertia_kg_m2 = specimen.inertia_kg_m2.map(|i| i.map(|i| i * factor));
    }
    rig.bodies.arm_a.mass_kg *= between(0.6, 2.0);
    rig.bodies.arm_b.mass_kg *= between(0.6, 2.0);
    scale(&mut rig.lower_push_rod, between(0.4, 8.0));
    scale(&mut rig.push_rod_a.bushing, between(0.3, 3.0));
    let cells = between(0.6, 1.6);
    rig.load_cells.iter_mut().for_each(|cell| scale(cell, cells));
    let springs = between(0.5, 2.0);
    rig.leaf_springs.iter_mut().for_each(|spring| scale(spring, springs));
    scale(&mut rig.knife_edge, between(0.5, 2.0));
    let damping = between(0.5, 2.0);
    for bushing in
        [&mut rig.knife_edge, &mut rig.lower_push_rod, &mut rig.clamp.loaded, &mut rig.clamp_b.loaded]
    {
        bushing.damping_s = bushing.damping_s.map(|beta| beta * damping);
    }
    let floor = between(0.3, 3.0);
    rig.sensors.vibrometer.floor *= floor;
    rig.sensors.ldv_a.floor *= floor;
    rig.sensors.ldv_b.floor *= floor;
    rig.sensors.load_cells.noise_n *= between(0.5, 2.0);

    for point in &mut rig.responses {
        point.sigma_m.iter_mut().for_each(|sigma_m| *sigma_m *= drawn.errors);
    }
    let errors = &mut rig.errors;
    for error in [
        &mut errors.position_m,
        &mut errors.aim_m,
        &mut errors.specimen_point_m,
        &mut errors.spot_m,
        &mut errors.hammer_angle_rad,
        &mut errors.skew_s,
        &mut errors.load_cell_cross_talk,
    ] {
        *error *= drawn.errors;
    }
    errors.gain = drawn.gain;
    errors.hammer_gain = drawn.gain;
    if let Some(which) = drawn.elastic {
        rig = elastic(number, rig, which);
    }
    if drawn.accelerometers { with_accelerometers(rig, drawn.errors) } else { rig }
}

/// The same rig with specimens, or specimens and arms, of steel or aluminium that bend; masses
/// remain. Both specimens have one material and section with edges of 8…20 mm; they reach from the
/// contact 1.1…1.6 times as far as the clamp. Arms are of one material too, with edges of 0.7…1.1
/// times those of the default rig's boxes. The draw has its own random stream, so that the rest of
/// the rig is that of the same number without it.
pub fn elastic(number: u64, mut rig: RigConfig, which: Elastic) -> RigConfig {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(0x00e1_a571_0000 + number);
    let mut between = |low: f64, high: f64| -> f64 {
        let u: f64 = random.random();
        low * (high / low).powf(u)
    };
    let material = |between: &mut dyn FnMut(f64, f64) -> f64| {
        let steel = between(1.0, 2.0) < 2.0_f64.sqrt();
        let (steels, aluminiums) = (between(200e9, 215e9), between(68e9, 73e9));
        let (young_pa, poisson) = if steel { (steels, 0.29) } else { (aluminiums, 0.33) };
        (young_pa, poisson, between(3e-8, 3e-7))
    };
    let (young_pa, poisson, damping_s) = material(&mut between);
    let section_m = [between(0.008, 0.02), between(0.008, 0.02)];
    let beyond = between(1.1, 1.6);
    let specimen = |clamp_m: f64| Beam {
        from_m: [0.0; 3],
        to_m: [0.0, clamp_m * beyond, 0.0],
        section_m,
        first_edge: None,
        young_pa,
        poisson,
        damping_s,
        elements: 1,
    };
    let clamps_m = [&rig.clamp, &rig.clamp_b].map(|clamp| clamp.loaded.position_m[1]);
    rig.bodies.specimen_a.beam = Some(specimen(clamps_m[0]));
    rig.bodies.specimen_b.beam = Some(specimen(clamps_m[1]));
    let (young_pa, poisson, damping_s) = material(&mut between);
    let edges = [between(0.7, 1.1), between(0.7, 1.1)];
    if which == Elastic::SpecimensAndArms {
        for arm in [&mut rig.bodies.arm_a, &mut rig.bodies.arm_b] {
            let ([_, y, z], [a, b, length]) = (arm.cg_m, arm.box_m.unwrap());
            arm.beam = Some(Beam {
                from_m: [0.0, y, z - length / 2.0],
                to_m: [0.0, y, z + length / 2.0],
                section_m: [a * edges[0], b * edges[1]],
                first_edge: None,
                young_pa,
                poisson,
                damping_s,
                elements: 2,
            });
        }
    }
    rig
}

/// Moves the contact's centre across the sliding direction and in height, with the standard
/// deviations of the analysis where the plan states none. The draw has its own random stream.
pub fn off_centre(number: u64, rig: &mut RigConfig) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(0x00ce_074e_0000 + number);
    let ContactPriors { contact_across_m, contact_height_m, .. } = ContactPriors::default();
    let [x, y]: [f64; 2] = std::array::from_fn(|_| random.sample(StandardNormal));
    let by_m = [contact_across_m * x, contact_height_m * y, 0.0];
    rig.errors.offset_m.insert("contact".into(), by_m);
}

/// The same rig with the sensors and the person of `accelerometers.toml`.
fn with_accelerometers(rig: RigConfig, errors: f64) -> RigConfig {
    assert!(rig.clamp_b.rigid, "rigs with a number that three divides have a clamp on side B");
    let mut like = RigConfig::from_toml(ACCELEROMETERS).unwrap();
    let louder = rig.sensors.vibrometer.floor / RigConfig::default().sensors.vibrometer.floor;
    like.sensors.fixed.iter_mut().for_each(|own| own.floor *= louder);
    like.sensors.load_cells.noise_n = rig.sensors.load_cells.noise_n;
    like.responses.iter_mut().flat_map(|point| &mut point.sigma_m).for_each(|sigma_m| *sigma_m *= errors);
    let position_m = errors * like.errors.position_m;
    RigConfig {
        sensors: like.sensors,
        responses: like.responses,
        hammer: like.hammer,
        errors: Errors { position_m, transverse: errors * like.errors.transverse, ..rig.errors },
        ..rig
    }
}

/// The rig without lasers.
const ACCELEROMETERS: &str = include_str!("../../hil-sim/rigs/accelerometers.toml");

/// The plan for such a rig: `contact-by-hand.toml` with the known standard deviations of its
/// errors.
pub fn by_hand_plan(rig: &RigConfig) -> String {
    let (head, tail) = CONTACT_BY_HAND.split_once("\n# Standard deviations of what is not known").unwrap();
    let (_, tail) = tail.split_once("\n# B alone").unwrap();
    let mut plan = format!("{head}\n# B alone{tail}");
    for point in &rig.responses {
        let (from, to) = plan.split_once(&format!("name = \"{}\"", point.name)).unwrap();
        let (of_point, rest) = to.split_once("sigma_m = ").unwrap();
        let (_, rest) = rest.split_once(',').unwrap();
        let sigma_m = point.sigma_m.unwrap();
        plan = format!("{from}name = \"{}\"{of_point}sigma_m = {sigma_m:?},{rest}", point.name);
    }
    with_priors(&plan, rig)
}

fn scale(bushing: &mut Bushing, factor: f64) {
    bushing.stiffness_n_per_m = bushing.stiffness_n_per_m.map(|k| k * factor);
    bushing.rotation_nm_per_rad = bushing.rotation_nm_per_rad.map(|k| k * factor);
}

/// The plan for such a rig: `contact.toml` with the known standard deviations of its errors.
pub fn contact_plan(rig: &RigConfig) -> String {
    with_priors(jointrig::campaign::plan::CONTACT, rig)
}

/// A plan with the known standard deviations of the rig's errors.
pub fn with_priors(plan: &str, rig: &RigConfig) -> String {
    let errors = &rig.errors;
    format!(
        "{plan}\n[priors]\nposition_m = {:?}\naim_m = {:?}\nhammer_angle_rad = {:?}\nspot_m = {:?}\nspecimen_point_m = {:?}\ngain = {:?}\n\
         hammer_gain = {:?}\nskew_s = {:?}\ntransverse = {:?}\n",
        errors.position_m,
        errors.aim_m,
        errors.hammer_angle_rad,
        errors.spot_m,
        errors.specimen_point_m,
        errors.gain,
        errors.hammer_gain,
        errors.skew_s,
        errors.transverse
    )
}

/// Frequencies of the shaker's levels on such a rig, Hz.
pub const LEVELS_HZ: [f64; 6] = [100.0, 150.0, 200.0, 300.0, 400.0, 500.0];

/// The same plan with shaker levels: 0.15 µm between the spots, at which every drawn contact
/// sticks.
pub fn levels_plan(rig: &RigConfig) -> String {
    let plan = contact_plan(rig);
    let last = "\"AZ2\", \"AZ3\"]";
    assert!(plan.contains(last));
    let where_it_pushes = plan.replace(last, "\"AZ2\", \"AZ3\", \"I_MZ\"]");
    format!("{where_it_pushes}\n[shaker]\nfrequencies_hz = {LEVELS_HZ:?}\namplitudes_m = [1.5e-7]\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_hil_sim::rig::Rig;

    #[test]
    fn elastic_rigs_stand_and_are_otherwise_the_rigid_ones() {
        let elastic = Drawn { elastic: Some(Elastic::SpecimensAndArms), ..Drawn::default() };
        let [mut soft, mut stiff] = [0, 0];
        for number in 700..712 {
            let (rigid, bends) = (drawn(number, Drawn::default()), drawn(number, elastic));
            assert_eq!(RigConfig::from_toml(&bends.to_toml()).unwrap(), bends, "{number}");
            let rig = Rig::new(&bends, 1).unwrap();
            assert_eq!(rig.fallback(), None, "{number}");
            let steel = bends.bodies.specimen_a.beam.as_ref().unwrap().young_pa > 1e11;
            if steel {
                stiff += 1;
            } else {
                soft += 1;
            }
            let (rigid_truth, truth) = (rigid.truth(), bends.truth());
            assert_eq!(rigid_truth.contact_k_t_n_per_m, truth.contact_k_t_n_per_m);
            assert!(truth.between_arms_k_n_per_m < rigid_truth.between_arms_k_n_per_m, "{number}");
            let mut same = bends.clone();
            let bodies = &mut same.bodies;
            for body in [&mut bodies.specimen_a, &mut bodies.specimen_b, &mut bodies.arm_a, &mut bodies.arm_b]
            {
                assert!(body.beam.take().is_some());
            }
            assert_eq!(same, rigid, "{number}");
        }
        assert!(soft > 0 && stiff > 0, "{soft} {stiff}");
    }
}
