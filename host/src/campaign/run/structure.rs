//! Checks, before anything moves, that the structure is the one that the file's records were
//! measured on: averages over two structures are valid for neither.

use jointrig_protocol::answer::Info;

use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::session_table::SessionInfo;
use crate::device::transport::Simulated;

/// Evidence, as text for the user, that this is another structure than before; `None` if there is
/// none, or nothing was measured yet.
pub(super) fn another(
    store: &Store,
    info: &Info,
    simulated: Option<&Simulated>,
) -> Result<Option<String>, StoreError> {
    if store.places()?.is_empty() && store.levels()?.is_empty() {
        return Ok(None);
    }
    if let (Some(was), Some(is)) = (store.simulated_rig()?, simulated) {
        let named = |name: &str, seed: u64| format!("the simulated rig `{name}`, seed {seed}");
        let (old, new) = (named(&was.name, was.seed), named(&is.rig, is.seed));
        return Ok(if old != new {
            Some(format!("its records are of {old}, and this is {new}"))
        } else if was.parameters.is_some_and(|old| old != is.parameters) {
            Some(format!("its records are of {old}, and a parameter of that rig is another one now"))
        } else {
            None
        });
    }
    let measured = |own: &&SessionInfo| own.board != SessionInfo::IMPORTED;
    let sessions = store.sessions()?;
    let Some(before) = sessions.iter().map(|(_, own)| own).rfind(measured) else { return Ok(None) };
    let same = (&*before.board, &*before.serial) == (info.board.as_str(), info.serial.as_str());
    Ok((!same).then(|| {
        format!(
            "its records are of the controller {} {}, and this is {} {}",
            before.board, before.serial, info.board, info.serial
        )
    }))
}

/// Refuses another structure, unless it is accepted: then returns the evidence, to be logged once
/// the session exists.
///
/// # Errors
/// The error that `refuse` makes of it, or the file cannot be read.
pub(super) fn same_or_accepted<E: From<StoreError>>(
    store: &Store,
    info: &Info,
    simulated: Option<&Simulated>,
    accepted: bool,
    refuse: impl FnOnce(String) -> E,
) -> Result<Option<String>, E> {
    match another(store, info, simulated)? {
        Some(what) if !accepted => Err(refuse(format!(
            "{}: {what}. Hits of two structures belong into two files: create one with `jointrig campaign new`. If it is the same \
             structure all the same (a controller was replaced), --new-structure goes on, and the report says so",
            store.path().display()
        ))),
        accepted => Ok(accepted),
    }
}
