//! Cells that are measured again after those of the plan, chosen by what was measured so far.

use crate::campaign::plan::configuration_name;
use crate::campaign::store::cell_table::CellRow;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Further good hits in a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FurtherCell {
    /// Name of its configuration: A, B or AJB.
    pub configuration: &'static str,
    /// The impact's name.
    pub impact: String,
    /// The response's name.
    pub response: String,
    /// Good hits to add.
    pub more: u32,
}

impl FurtherCell {
    /// Whether it is this cell of the file.
    pub fn is(&self, row: &CellRow) -> bool {
        let cell = &row.cell;
        configuration_name(cell.configuration) == self.configuration
            && cell.impact == self.impact
            && cell.response == self.response
    }
}

/// What is measured next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// These cells, in this order; after them the chooser is asked again.
    Cells {
        /// The cells.
        cells: Vec<FurtherCell>,
        /// Why, as a sentence.
        why: String,
    },
    /// Nothing: the run ends.
    Enough {
        /// Whether the run has what it was to measure.
        reached: bool,
        /// Why, as a sentence.
        why: String,
    },
}

/// Chooses the cells that are measured after those of the plan.
pub trait ChooseFurther: Send {
    /// The next cells, from the campaign file, which contains everything measured so far. Cells for
    /// which `excluded` holds cannot be measured in this run.
    ///
    /// # Errors
    /// The file cannot be read, as a sentence.
    fn next(
        &mut self,
        file: &Path,
        excluded: &(dyn Fn(&FurtherCell) -> bool + Sync),
    ) -> Result<Choice, String>;
}

/// A chooser that a run can share.
#[derive(Clone)]
pub struct Further(Arc<Mutex<dyn ChooseFurther>>);

impl Further {
    /// From a chooser.
    pub fn new(chooser: impl ChooseFurther + 'static) -> Self {
        Self(Arc::new(Mutex::new(chooser)))
    }

    pub(super) fn chooser(&self) -> MutexGuard<'_, dyn ChooseFurther + 'static> {
        // a chooser holds nothing that a panic leaves half changed: it reads the file again
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Further {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("further cells")
    }
}
