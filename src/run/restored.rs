//! How a run finds the checkpoint that it goes on from.

use super::Start;
use crate::{
    body::Body,
    error::{Error, Exit, Result},
    output::{
        checkpoint::{self, Identity},
        checkpoint_folder::list,
        history::Totals,
    },
    session::Session,
    state::State,
};
use std::path::Path;

/// Where a restarted run comes from.
pub(super) struct Restored {
    pub file: String,
    pub totals: Totals,
    /// What the log says about it.
    pub words: Vec<String>,
}

/// Puts the checkpoint that `start` asks for into the state. Collective.
pub(super) fn restore<const D: usize, const S: usize>(
    session: &Session,
    start: &Start,
    folder: &Path,
    identity: &Identity,
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<Option<Restored>> {
    let candidates = match start {
        Start::Anew | Start::Over => return Ok(None),
        Start::From(path) => vec![path.clone()],
        Start::Newest => session.agree(list(folder))?.into_iter().map(|(_, path)| path).collect(),
    };
    let mut faults = Vec::new();
    for path in &candidates {
        match checkpoint::restore(session, path, identity, body, state) {
            Ok(header) => {
                let file = path.display().to_string();
                let mut words: Vec<String> = faults.iter().map(|fault| format!("warning: {fault}")).collect();
                words.push(format!("going on from {file} (step {}, t = {} s)", header.step, header.time));
                return Ok(Some(Restored { file, totals: header.totals, words }));
            }
            Err(error) if error.exit() == Exit::Refused => return Err(error),
            Err(error) => faults.push(error.to_string()),
        }
    }
    Err(Error::Refused(if faults.is_empty() {
        format!("{}: no checkpoint to go on from; run without --restart", folder.display())
    } else {
        format!("no good checkpoint to go on from; run without --restart\n{}", faults.join("\n"))
    }))
}
