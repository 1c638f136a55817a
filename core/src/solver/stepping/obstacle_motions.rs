//! The motions of obstacles that forces drive, as unknowns of Newton's method.
//!
//! With the unknowns of nodes relative to their obstacles (`fem/effect/contact/driven.rs`) a step is
//!
//! ```text
//! r = K v + C(x) - b = 0,   v = V(x) + M w
//! f = m (w - w~) / k' - F - N . C(x) = 0
//! ```
//!
//! for the velocities `w` of the motions: a row and a column each beside those of the nodes. `f` is evaluated in the sum `f + N . r`, in
//! which the contact forces cancel: with `s = m / k' + N . K M` it is `s w + N . K V(x)` but for known terms, symmetric with the rest where
//! `N = M`, and not small where a light obstacle rests on a stiff body. Of each residual `w` is eliminated by this sum, and so it is of the
//! linear equations of a Newton iteration, whose matrix is `K - K M s^-1 N . K` and the slopes of the laws. The nodal residual is then the
//! only one; where it vanishes, so does `f`.
//!
//! An obstacle without mass that touches nothing has no equation for its velocity. It is moved until its force presses it against the body.

use crate::{
    error::{Error, Result},
    fem::effect::{Contact, Freedom, LoadedMotion},
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};
use std::{cmp::Ordering, fmt::Write};

/// Evaluations of the velocities of one residual: after how many they must lower the unbalanced forces, and at most.
const EVALUATIONS: [usize; 2] = [0, 6];
/// The same where obstacles rest on held points, whose pressures may grow as a power of the penetration from zero.
const HELD_EVALUATIONS: [usize; 2] = [10, 60];
/// An evaluation that leaves more than this share of the unbalanced forces has met their rounding errors.
const LEAST_DECREASE: f64 = 0.5;
/// Share of the tolerance of nodal forces to which velocities are evaluated.
const SHARE: f64 = 0.01;
/// Share of the terms of an equation that is their rounding error.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// The unbalanced force on an obstacle relative to the largest of its terms, as a multiple of the tolerance of steps, above which its
/// motion is not solved.
const OBSTACLE_SHARE: f64 = 10.0;

/// The motions of all contacts.
#[derive(Default)]
pub struct ObstacleMotions {
    motions: Vec<Motion>,
    /// `s` by rows.
    slopes: Vec<f64>,
    /// Whether some motion changes nodal velocities otherwise than the velocities work against forces on the obstacle.
    is_unsymmetric: bool,
    /// The residual norm in N at which the nodal equations count as solved.
    tolerance: f64,
    /// A contact that has touched although its unknowns do not follow the obstacle.
    touched: Option<usize>,
    /// One that has parted although they do, and whether this is still to be acted on.
    parted: Option<usize>,
    may_part: bool,
    /// For each motion the last `f + N . r`, the last `f` and the largest of its terms, and the largest of the first relative to the accuracy.
    values: Vec<f64>,
    unbalanced: Vec<[f64; 2]>,
    largest: f64,
    /// The velocities that [`keep`](Self::keep) kept.
    kept: Vec<f64>,
    work: Vec<f64>,
    sums: Vec<f64>,
}

/// One motion.
struct Motion {
    /// The number of the contact, and the degree of freedom of its obstacle.
    place: (usize, Freedom),
    /// `N`.
    velocities: DistributedVector,
    /// `M`.
    column: DistributedVector,
    /// `K` times the column, with the derivatives of forces of cells.
    forces: DistributedVector,
    /// The norm of `N`.
    size: f64,
    /// The velocity in m/s that moves by the distances of which gaps are differences in a step.
    places: f64,
    /// `m / k'`.
    inertia: f64,
    /// What held points add to its `s`.
    held: f64,
    /// Whether held points may stop it; the changes of its velocity at which it is beyond none of them; and the change with which it reaches
    /// those that stop it.
    has_stops: bool,
    room: [f64; 2],
    stop: Option<f64>,
    /// The change of its velocity in the next iteration, if nothing holds it.
    approach: Option<f64>,
}

impl ObstacleMotions {
    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.motions.is_empty()
    }

    /// Starts the solution of equations to this residual norm in N from velocities `start`: sets the columns for the contacts as they
    /// are; `multiply` is the product with `K`. Collective.
    pub(super) fn start<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &mut [Contact<D>],
        start: &DistributedVector,
        tolerance: f64,
        multiply: impl FnMut(&DistributedVector, &mut DistributedVector) -> Result<()>,
    ) -> Result<()> {
        (self.tolerance, self.may_part) = (tolerance, true);
        if contacts.iter().any(|contact| contact.obstacle.is_driven()) {
            find_contacts(session, contacts, start)?;
        }
        self.set_columns(session, contacts, start, multiply)?;
        let translations = self.motions.iter_mut().filter(|motion| motion.place.1 == Freedom::Translation);
        translations.for_each(|motion| {
            [motion.places] = session.largest([contacts[motion.place.0].speed_of_places()]);
        });
        Ok(())
    }

    /// Lets the unknowns of a contact follow its obstacle if they have touched unexpectedly, and no longer if they have parted; returns
    /// whether there is such a contact. Collective.
    pub(super) fn follow_new_contacts<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &mut [Contact<D>],
        start: &DistributedVector,
        multiply: impl FnMut(&DistributedVector, &mut DistributedVector) -> Result<()>,
    ) -> Result<bool> {
        if let Some(contact) = self.parted.take() {
            self.may_part = false;
            session.agree(contacts[contact].follow_obstacle(false))?;
            for freedom in Freedom::ALL {
                let Some(motion) = &mut contacts[contact].obstacle.motions[freedom as usize] else {
                    continue;
                };
                let free = motion.velocity() + motion.change_to_free();
                if free.is_finite() {
                    motion.set_velocity(free);
                }
            }
            session.agree(contacts[contact].place_obstacle())?;
        } else if let Some(contact) = self.touched.take() {
            session.agree(contacts[contact].follow_obstacle(true))?;
        } else {
            return Ok(false);
        }
        self.set_columns(session, contacts, start, multiply)?;
        Ok(true)
    }

    /// Sets the columns for the contacts as they are; `multiply` is the product with `K`. Collective.
    pub(super) fn set_columns<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        like: &DistributedVector,
        multiply: impl FnMut(&DistributedVector, &mut DistributedVector) -> Result<()>,
    ) -> Result<()> {
        (self.touched, self.parted) = (None, None);
        let driven = contacts.iter().enumerate().flat_map(|(contact, laws)| {
            Freedom::ALL.into_iter().zip(&laws.obstacle.motions).filter_map(move |(freedom, motion)| {
                motion.as_ref().map(|motion| ((contact, freedom), motion.inertia()))
            })
        });
        for (at, (place, inertia)) in driven.enumerate() {
            if at == self.motions.len() {
                let [velocities, column, forces] = [like.like()?, like.like()?, like.like()?];
                self.motions.push(Motion {
                    place,
                    velocities,
                    column,
                    forces,
                    size: 0.0,
                    places: 0.0,
                    inertia,
                    held: 0.0,
                    has_stops: false,
                    room: ANYWHERE,
                    stop: None,
                    approach: None,
                });
            }
            let motion = &mut self.motions[at];
            (motion.place, motion.inertia, motion.held, motion.approach) = (place, inertia, 0.0, None);
            let (contact, freedom) = place;
            let has_stops =
                freedom == Freedom::Translation && contacts[contact].normal.approach().has_stops();
            (motion.has_stops, motion.stop) = (session.total(usize::from(has_stops)) > 0, None);
            motion.velocities.fill(0.0)?;
            contacts[contact].add_material_motion(freedom, &mut motion.velocities.owned_mut()?);
            motion.size = motion.velocities.norm()?;
        }
        if self.is_empty() {
            return Ok(());
        }
        self.linearise(session, contacts, multiply)
    }

    /// Sets the columns, `K` times them and the slopes; `multiply` is the product with `K` and the derivatives of forces of cells.
    /// Collective.
    pub(super) fn linearise<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        mut multiply: impl FnMut(&DistributedVector, &mut DistributedVector) -> Result<()>,
    ) -> Result<()> {
        let count = self.motions.len();
        session.agree(self.write_columns(contacts))?;
        for Motion { column, forces, .. } in &mut self.motions {
            multiply(column, forces)?;
        }
        self.work.clear();
        for (row, column) in (0..count * count).map(|at| (at / count, at % count)) {
            self.work.push(own_dot(&self.motions[row].velocities, &self.motions[column].forces)?);
        }
        for Motion { velocities, column, .. } in &self.motions {
            self.work.push(square_of_difference(velocities, column)?);
            self.work.push(own_dot(column, column)?);
        }
        session.sum_lists_into(&self.work, &mut self.slopes);
        let differences = self.slopes[count * count..].as_chunks().0.iter();
        self.is_unsymmetric =
            { differences }.any(|[difference, size]| *difference > PARALLEL * PARALLEL * size);
        self.slopes.truncate(count * count);
        (0..count).for_each(|at| self.slopes[at * count + at] += self.motions[at].inertia);
        Ok(())
    }

    /// Writes the columns of the motions.
    fn write_columns<const D: usize>(&mut self, contacts: &[Contact<D>]) -> Result<()> {
        for Motion { place: (contact, freedom), column, .. } in &mut self.motions {
            column.fill(0.0)?;
            contacts[*contact].add_motion(*freedom, &mut column.owned_mut()?)?;
        }
        Ok(())
    }

    /// Evaluates the equations of the motions at a nodal residual `r` in N, whose velocities have ghosts where contacts need them, and
    /// changes their velocities accordingly; returns whether the residual is to be evaluated anew. Collective.
    pub(super) fn update<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &mut [Contact<D>],
        (velocity, residual): (&[f64], &DistributedVector),
        evaluation: usize,
    ) -> Result<bool> {
        let count = self.motions.len();
        self.work.clear();
        for Motion { place: (contact, freedom), .. } in &self.motions {
            self.work.push(contacts[*contact].resultant(*freedom, velocity));
        }
        for motion in &self.motions {
            self.work.push(own_dot(&motion.velocities, residual)?);
        }
        for Motion { place: (contact, _), .. } in &self.motions {
            let laws = &mut contacts[*contact];
            let is_new = laws.follow_along_new_tangents() || (!laws.obstacle.follows && laws.has_tractions());
            self.work.push(f64::from(u8::from(is_new)));
        }
        for Motion { place: (contact, freedom), .. } in &self.motions {
            self.work.push(contacts[*contact].held_stiffness(*freedom, velocity));
        }
        session.sum_lists_into(&self.work, &mut self.sums);
        let sums = &self.sums;
        self.motions.iter_mut().zip(&sums[3 * count..]).for_each(|(motion, held)| motion.held = *held);
        if let Some(at) = sums[2 * count..3 * count].iter().position(|touching| *touching > 0.0) {
            self.touched = Some(self.motions[at].place.0);
            return Err(Error::Failed(NO_CONTACT.into()));
        }
        self.values.clear();
        self.unbalanced.clear();
        for (at, Motion { place: (contact, freedom), .. }) in self.motions.iter().enumerate() {
            let Some(motion) = &mut contacts[*contact].obstacle.motions[*freedom as usize] else { continue };
            let [open, terms] = motion.unbalanced(sums[at]);
            self.values.push(open + sums[count + at]);
            self.unbalanced.push([open, terms]);
        }
        self.find_stops(session, contacts, velocity);
        let mut largest = 0.0;
        for (at, Motion { size, stop, .. }) in self.motions.iter().enumerate() {
            let (value, [_, terms]) = (self.values[at], self.unbalanced[at]);
            let enough = f64::max(SHARE * self.tolerance * size, ROUNDING * terms);
            largest = if value == 0.0 { largest } else { f64::max(largest, value.abs() / enough) };
            if !value.is_finite() {
                largest = f64::NAN;
            } else if stop.is_some_and(|change| change != 0.0) {
                largest = f64::MAX;
            }
        }
        let rests = self.motions.iter().any(|motion| motion.held > 0.0 || motion.has_stops);
        let [patience, most] = if rests { HELD_EVALUATIONS } else { EVALUATIONS };
        let is_slow = evaluation > patience && largest > LEAST_DECREASE * self.largest;
        self.largest = largest;
        if largest <= 1.0 || !largest.is_finite() || is_slow || evaluation + 1 == most {
            return Ok(false);
        }
        self.solve(|motion| motion.stop.is_none());
        self.press_on_held(session, contacts, velocity);
        for (Motion { room: [least, greatest], stop, .. }, value) in self.motions.iter().zip(&mut self.values)
        {
            *value = -stop.unwrap_or(-*value).max(*least).min(*greatest);
        }
        let mut placed = Ok(());
        for (Motion { place: (contact, freedom), .. }, change) in self.motions.iter().zip(&self.values) {
            if let Some(motion) = &mut contacts[*contact].obstacle.motions[*freedom as usize] {
                motion.set_velocity(motion.velocity() - change);
            }
        }
        for contact in contacts.iter_mut() {
            placed = placed.and_then(|()| contact.place_obstacle());
        }
        session.agree(placed)?;
        Ok(true)
    }

    /// Replaces the change of a motion that has no equation, because it only presses on held points and does not touch them yet, by that
    /// with which it does. Collective.
    fn press_on_held<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        velocity: &[f64],
    ) {
        for (at, motion) in self.motions.iter().enumerate() {
            let [open, _] = self.unbalanced[at];
            if open == 0.0 || motion.stop.is_some() || self.diagonal(at) != 0.0 {
                continue;
            }
            if let Some(change) = change_to_press(session, contacts, motion, (open, velocity)) {
                self.values[at] = -change;
                self.largest = f64::MAX;
            }
        }
    }

    /// Finds the motions that held points stop, and balances their forces by pressures at these points. Collective.
    fn find_stops<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &mut [Contact<D>],
        velocity: &[f64],
    ) {
        for (at, motion) in self.motions.iter_mut().enumerate() {
            (motion.room, motion.stop) = (ANYWHERE, None);
            if !motion.has_stops {
                continue;
            }
            let (contact, freedom) = motion.place;
            let (laws, [open, _]) = (&mut contacts[contact], self.unbalanced[at]);
            let [least, greatest] = laws.normal.approach().room(velocity);
            let [least, greatest] = session.largest([least, -greatest]);
            motion.room = [least, -greatest];
            // Beyond a stop the obstacle is moved back, whatever its force.
            let sign = match motion.room {
                [_, greatest] if greatest < 0.0 => 1.0,
                [least, _] if least > 0.0 => -1.0,
                _ => -self.values[at].signum(),
            };
            let [area] = session.sum([laws.normal.approach().stopping_area(sign, velocity)]);
            let reaction = if area > 0.0 && sign * open < 0.0 { open } else { 0.0 };
            laws.normal.stop(sign, if reaction == 0.0 { 0.0 } else { reaction / area }, velocity);
            if area > 0.0
                && let Some(driven) = &mut laws.obstacle.motions[freedom as usize]
            {
                self.unbalanced[at] = driven.unbalanced(self.sums[at] + reaction);
                motion.stop = Some(f64::max(0.0, least).min(-greatest));
                self.values[at] = 0.0;
            }
        }
    }

    /// The diagonal entry of `s`.
    fn diagonal(&self, at: usize) -> f64 {
        self.slopes[at * self.motions.len() + at] + self.motions[at].held
    }

    /// Replaces the values by `s^-1` times them for these motions, and by 0 for all others.
    fn solve(&mut self, is_in: impl Fn(&Motion) -> bool) {
        let count = self.motions.len();
        self.work.clone_from(&self.slopes);
        (0..count).for_each(|at| self.work[at * count + at] = self.diagonal(at));
        for (at, _) in self.motions.iter().enumerate().filter(|(_, motion)| !is_in(motion)) {
            for other in 0..count {
                self.work[at * count + other] = f64::from(u8::from(other == at));
                if other != at {
                    self.work[other * count + at] = 0.0;
                }
            }
            self.values[at] = 0.0;
        }
        solve_dense(&mut self.work, &mut self.values);
    }

    /// Finds the motions that nothing holds, at velocities of nodes and derivatives of laws of the last linearisation, and how they are to
    /// move; fails if they cannot come into contact. Collective.
    pub(super) fn find_loose<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        velocity: &[f64],
    ) -> Result<()> {
        for (at, motion) in self.motions.iter_mut().enumerate() {
            motion.approach = None;
            let (contact, freedom) = motion.place;
            let laws = &contacts[contact];
            let [grip] = session.sum([laws.grip(freedom) + laws.held_stiffness(freedom, velocity)]);
            if grip > 0.0 || motion.stop.is_some() {
                continue;
            }
            let driving =
                laws.obstacle.motions[freedom as usize].as_ref().map_or(0.0, |motion| motion.driving);
            let [open, _] = self.unbalanced.get(at).copied().unwrap_or([-driving, 0.0]);
            if open == 0.0 {
                motion.approach = Some(0.0);
                continue;
            }
            let press = change_to_press(session, contacts, motion, (open, velocity));
            // Relative to a distant obstacle, velocities of the body would be rounding errors.
            if press.is_none() && freedom == Freedom::Translation && self.may_part && laws.obstacle.follows {
                self.parted = Some(contact);
                return Err(Error::Failed(NO_CONTACT.into()));
            }
            let change = press.unwrap_or(-open / motion.inertia);
            if !change.is_finite() {
                return Err(Error::Failed(NO_CONTACT.into()));
            }
            motion.approach = Some(change);
        }
        Ok(())
    }

    /// Adds to a right-hand side of the linear equations what the motions that nothing holds contribute.
    pub(super) fn add_approach(&self, forces: &mut DistributedVector) -> Result<()> {
        for motion in &self.motions {
            if let Some(change) = motion.approach.filter(|change| *change != 0.0) {
                forces.add_scaled(change, &motion.forces)?;
            }
        }
        Ok(())
    }

    /// Adds to the forces `K z` of a change `z` of the velocities relative to obstacles those of the change `w` that follows. Collective.
    pub(super) fn add_changes(&mut self, session: &Session, forces: &mut DistributedVector) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        self.work.clear();
        for motion in &self.motions {
            self.work.push(own_dot(&motion.velocities, forces)?);
        }
        session.sum_lists_into(&self.work, &mut self.values);
        self.solve(|motion| motion.approach.is_none() && motion.stop.is_none());
        for (motion, change) in self.motions.iter().zip(&self.values) {
            if *change != 0.0 {
                forces.add_scaled(-change, &motion.forces)?;
            }
        }
        Ok(())
    }

    /// Keeps the velocities of all motions.
    pub(super) fn keep<const D: usize>(&mut self, contacts: &[Contact<D>]) {
        let velocity = |(contact, freedom): (usize, Freedom)| {
            contacts[contact].obstacle.motions[freedom as usize].as_ref().map_or(0.0, LoadedMotion::velocity)
        };
        self.kept.clear();
        self.kept.extend(self.motions.iter().map(|motion| velocity(motion.place)));
    }

    /// Sets the velocities that were kept last.
    pub(super) fn restore<const D: usize>(&self, contacts: &mut [Contact<D>]) -> Result<()> {
        for (Motion { place: (contact, freedom), .. }, velocity) in self.motions.iter().zip(&self.kept) {
            let motion = &mut contacts[*contact].obstacle.motions[*freedom as usize];
            motion.iter_mut().for_each(|motion| motion.set_velocity(*velocity));
        }
        contacts.iter_mut().try_for_each(Contact::place_obstacle)
    }

    /// The norm in m/s of the velocities by which nodes follow obstacles since the start of the step, and of those that move by the distances
    /// from which gaps are evaluated: velocities are rounded as differences from them.
    pub(super) fn speed<const D: usize>(&self, contacts: &[Contact<D>]) -> f64 {
        let change = |(contact, freedom): (usize, Freedom)| {
            contacts[contact].obstacle.motions[freedom as usize].as_ref().map_or(0.0, LoadedMotion::change)
        };
        let speed = |motion: &Motion| motion.size * (change(motion.place).abs() + motion.places);
        self.motions.iter().map(speed).sum()
    }

    /// Whether a motion changes nodal velocities otherwise than the velocities work against forces on the obstacle.
    pub(super) fn is_unsymmetric(&self) -> bool {
        self.is_unsymmetric
    }

    /// The reason why the motions are not solved, given the norm of the nodal residual in N and the relative tolerance of steps.
    pub(super) fn failure(&self, residual: f64, relative: f64) -> Option<String> {
        let is_open = |([open, terms], motion): (&[f64; 2], &Motion)| {
            let share = f64::max(relative * terms, motion.size * residual.max(self.tolerance));
            matches!(open.abs().partial_cmp(&(OBSTACLE_SHARE * share)), Some(Ordering::Greater) | None)
        };
        if !self.unbalanced.iter().zip(&self.motions).any(is_open) {
            return None;
        }
        let mut text = NO_BALANCE.to_owned();
        for (at, [open, _]) in self.unbalanced.iter().enumerate() {
            let _ = write!(text, "{}{open:.1e}", if at == 0 { ": " } else { ", " });
        }
        Some(text + " N or N m remain")
    }
}

/// The difference of row and column relative to the column below which the system is symmetric but for rounding errors of the derivatives
/// of gaps.
const PARALLEL: f64 = 1e-5;

/// The changes of a velocity that nothing limits.
const ANYWHERE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

const NO_BALANCE: &str = "no motion of the obstacles balances their forces and moments";
const NO_CONTACT: &str = "no motion of the obstacles balances their forces and moments: an obstacle without mass touches nothing that holds \
     it, or the body yields to its force; let the forces press the obstacles against the body, move the obstacles by their keys in place \
     of a force, or give them a mass and take a smaller [time] step; an obstacle that a moment turns may need a moment_of_inertia";

/// The change of the velocity of a motion that nothing holds with which it touches a point in the step and its unbalanced force in N presses
/// it on; `None` if the force does not move it so far. Velocities are those of Newton's method. Collective.
fn change_to_press<const D: usize>(
    session: &Session,
    contacts: &[Contact<D>],
    motion: &Motion,
    (open, velocity): (f64, &[f64]),
) -> Option<f64> {
    let (contact, freedom) = motion.place;
    let (laws, sign) = (&contacts[contact], -open.signum());
    let nearest = match freedom {
        Freedom::Translation => laws.normal.approach().change_to_touch(velocity, sign),
        Freedom::Rotation => f64::INFINITY,
    };
    let nearest = -session.largest([-nearest])[0];
    let [area] = session.sum([laws.normal.boundary().area()]);
    let left = open.abs() - motion.inertia * nearest;
    (left > 0.0).then(|| sign * (nearest + left / (motion.inertia + laws.normal.scale * area)))
}

/// Lets the unknowns of the contacts follow their obstacles, except those that are apart at the velocities from which a step starts.
/// Collective.
fn find_contacts<const D: usize>(
    session: &Session,
    contacts: &mut [Contact<D>],
    start: &DistributedVector,
) -> Result<()> {
    let velocity = start.owned()?;
    for contact in contacts.iter_mut().filter(|contact| contact.obstacle.is_driven()) {
        let approach = contact.normal.approach();
        let mut touches = contact.has_tractions() || approach.would_touch(&velocity);
        let [along, _] = &contact.obstacle.motions;
        if let Some(change) = along.as_ref().map(LoadedMotion::change_to_free) {
            touches |= approach.change_to_touch(&velocity, change.signum()) <= change.abs();
        }
        let touches = session.total(usize::from(touches)) > 0;
        session.agree(contact.follow_obstacle(touches))?;
        contact.follow_along_tangents(session, &velocity);
    }
    Ok(())
}

/// The part of a scalar product on this rank.
fn own_dot(one: &DistributedVector, other: &DistributedVector) -> Result<f64> {
    Ok(one.owned()?.iter().zip(&*other.owned()?).map(|(a, b)| a * b).sum())
}

/// The part of the square of the norm of a difference on this rank.
fn square_of_difference(one: &DistributedVector, other: &DistributedVector) -> Result<f64> {
    Ok(one.owned()?.iter().zip(&*other.owned()?).map(|(a, b)| (a - b) * (a - b)).sum())
}

/// Replaces the right-hand side by the solution of equations with this matrix, given by rows; by 0 where a row has no entries.
fn solve_dense(matrix: &mut [f64], right_hand_side: &mut [f64]) {
    let count = right_hand_side.len();
    for step in 0..count {
        let row = (step..count).fold(step, |best, row| {
            if matrix[row * count + step].abs() > matrix[best * count + step].abs() { row } else { best }
        });
        if matrix[row * count + step] == 0.0 {
            matrix[step * count..][..count].fill(0.0);
            continue;
        }
        (0..count).for_each(|column| matrix.swap(row * count + column, step * count + column));
        right_hand_side.swap(row, step);
        for below in step + 1..count {
            let factor = matrix[below * count + step] / matrix[step * count + step];
            (step..count)
                .for_each(|column| matrix[below * count + column] -= factor * matrix[step * count + column]);
            right_hand_side[below] -= factor * right_hand_side[step];
        }
    }
    for step in (0..count).rev() {
        let pivot = matrix[step * count + step];
        let known: f64 =
            (step + 1..count).map(|column| matrix[step * count + column] * right_hand_side[column]).sum();
        right_hand_side[step] = if pivot == 0.0 { 0.0 } else { (right_hand_side[step] - known) / pivot };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_systems_are_solved_with_pivots_and_empty_rows() {
        let mut value = [5.0, 2.0, 7.0];
        solve_dense(&mut [0.0, 2.0, 1.0, 1.0, 0.0, 0.0, 3.0, 0.0, -1.0], &mut value);
        assert!(
            value.iter().zip([2.0, 3.0, -1.0]).all(|(found, right)| (found - right).abs() < 1e-12),
            "{value:?}"
        );
        let mut value = [3.0, 4.0];
        solve_dense(&mut [0.0, 0.0, 0.0, 2.0], &mut value);
        assert_eq!(value, [0.0, 2.0], "a motion without an equation keeps its velocity");
    }
}
