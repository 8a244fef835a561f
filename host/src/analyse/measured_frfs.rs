//! The FRFs of one configuration of a campaign file, over any range of lines.

use super::assemble::{everything, hits};
use super::averages::{Asked, CellAverage, CellSums};
use super::cell::{CellName, Measurements};
use super::from_store::CampaignFile;
use crate::structure::Structure;
use crate::substructuring::Frf;
use nalgebra::DMatrix;
use rayon::prelude::*;

impl CampaignFile {
    /// The FRFs of a configuration's kept hits between two frequencies, Hz, for every pair of the
    /// geometry, computed as in the analysis, with the number of hits in each (outputs × inputs);
    /// and messages about cells and records that cannot be used. `None` without a kept hit.
    pub fn measured(
        &self,
        structure: Structure,
        lines_hz: [f64; 2],
    ) -> (Option<(Frf, DMatrix<usize>)>, Vec<String>) {
        let own: Vec<&CellName> =
            self.cells.iter().map(|cell| &cell.name).filter(|name| name.configuration == structure).collect();
        let one = |name: &&CellName| {
            let complaint =
                |what: String| format!("{structure}: cell {} × {}: {what}.", name.impact, name.response);
            let mut sums = CellSums::new((*name).clone(), self.sigma_per_s(), Asked::default(), lines_hz);
            let (mut some, mut unfit) = (false, None);
            let read = self.each_hit(name, false, &mut |hit, fs_hz| {
                some = true;
                if unfit.is_none() {
                    unfit = sums.add(hit, fs_hz).err();
                }
            });
            let left_out = match read {
                Ok(left_out) => left_out,
                Err(error) => return (None, vec![complaint(error.to_string())]),
            };
            let mut complaints: Vec<String> = left_out.into_iter().map(complaint).collect();
            if !some {
                return (None, complaints);
            }
            let found = unfit.map_or_else(|| sums.finish(), Err);
            complaints.extend(found.as_ref().err().map(|error| complaint(error.to_string())));
            (found.ok(), complaints)
        };
        let (averages, complaints): (Vec<_>, Vec<_>) = own.par_iter().map(one).unzip();
        let averages: Vec<CellAverage> = averages.into_iter().flatten().collect();
        let complaints = complaints.concat();
        let points = self.geometry().points(structure);
        let found = everything(points, &averages, self.quantity());
        (found.map(|frf| (frf, hits(points, &averages))), complaints)
    }
}
