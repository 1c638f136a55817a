//! Runs of a study side by side, each on a group of ranks.

use super::{
    execute::{Speaker, announced},
    plan::{Plan, Planned},
    record::{Ran, Record},
};
use crate::{
    error::{Error, Result},
    parallel::session::Session,
};

/// A run with its number of repetitions and its place among all runs, for messages.
pub(super) type Numbered<'a> = (&'a Planned, usize, String);

/// Executes runs: those that may run side by side in groups of ranks, the others on all ranks, one after the other; `None` if they were
/// requested to stop. A failed run does not affect the others. Collective, with the same results on all ranks.
pub(super) fn execute_all(
    session: &Session,
    plan: &Plan,
    runs: &[Numbered],
    speaker: Speaker<'_>,
) -> Result<Option<Vec<Ran>>> {
    let (grouped, alone): (Vec<usize>, Vec<usize>) =
        (0..runs.len()).partition(|at| runs[*at].0.is_side_by_side);
    let mut all: Vec<Option<Ran>> = runs.iter().map(|_| None).collect();
    for at in alone {
        let (planned, repetitions, number) = &runs[at];
        let Some(ran) = announced(session, planned, *repetitions, number, speaker)? else { return Ok(None) };
        all[at] = Some(ran);
    }
    let least = session.agree(least_ranks(session, plan))?;
    let groups = (session.ranks() / least).min(grouped.len());
    if groups == 0 {
        return Ok(Some(all.into_iter().flatten().collect()));
    }
    if groups > 1 {
        speaker.say(&format!("{} runs side by side, {groups} at a time", grouped.len()));
    }
    let group = session.rank() * groups / session.ranks();
    let mine: Vec<&Numbered> = grouped.iter().skip(group).step_by(groups).map(|at| &runs[*at]).collect();
    let found = session.in_group(group, |ranks| execute_mine(ranks, &mine, speaker.of_group(ranks)))?;
    // All groups meet here, also those with a failure.
    let found = session.agree(found)?;
    if session.total(usize::from(found.is_none())) > 0 {
        return Ok(None);
    }
    let mut marks = vec![0.0; grouped.len()];
    for (place, mine) in (group..grouped.len()).step_by(groups).zip(found.unwrap_or_default()) {
        marks[place] = f64::from(u8::from(mine));
    }
    let marks = session.sum_of_lists(&marks);
    for (at, mark) in grouped.into_iter().zip(marks) {
        let read = session.on_first(|| Record::read(runs[at].0.loaded.job.output_folder()))?;
        let record = Record::share(session, read)?;
        let record = record.ok_or_else(|| Error::Internal("a run left no record".into()))?;
        all[at] = Some(Ran { record, found: mark > 0.0 });
    }
    Ok(Some(all.into_iter().flatten().collect()))
}

/// Executes the runs of a group, one after the other; for each, whether an earlier study had finished it, on the first rank of the
/// group. `None` if they were requested to stop. Collective over the group.
fn execute_mine(ranks: &Session, mine: &[&Numbered], speaker: Speaker<'_>) -> Result<Option<Vec<bool>>> {
    let mut found = Vec::new();
    for (planned, repetitions, number) in mine {
        match announced(ranks, planned, *repetitions, number, speaker)? {
            Some(ran) => found.push(ran.found && ranks.is_first()),
            None => return Ok(None),
        }
    }
    Ok(Some(found))
}

/// The least number of ranks of a run; refused if there are fewer.
fn least_ranks(session: &Session, plan: &Plan) -> Result<usize> {
    let least = plan.study.timing.ranks.map_or(1, |ranks| ranks as usize);
    if least <= session.ranks() {
        return Ok(least);
    }
    Err(Error::Refused(format!(
        "[timing] ranks = {least}, but the study was started on {} rank(s): start it with mpirun -n {least}, or on more ranks for \
         runs side by side",
        session.ranks()
    )))
}
