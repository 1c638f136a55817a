//! The step of the temperature: with the heat that motion is expected to release before the motion of the step is solved, and with that
//! which it has released afterwards. See [`Heat`] for its equations.
//!
//! [`Heat`]: crate::fem::effect::Heat

use super::{linear_solver::Preconditioner, step_error::TemperatureError, substructuring::SharedFactor};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{
            Conditions, Curvature, ENTERED_HEAT, Energy, FLOW_HEAT, FRICTION_HEAT, Heat, LOST_HEAT,
            STORED_HEAT, Step,
        },
    },
    linear_algebra::{
        petsc::{BlockRows, DistributedVector, Ksp, Matrix},
        tensor::larger,
    },
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};

/// The residual of a solved step as a share of the powers that change the temperature.
const TOLERANCE: f64 = 1e-13;
/// Iterations after which a solve fails.
const ITERATIONS: usize = 10_000;
/// The largest conduction within a step over the capacity at which the diagonal is a better preconditioner than multigrid, and than a factor.
const SHORT: [f64; 2] = [100.0, 10.0];

/// The solver of the temperature at the end of steps.
#[derive(Debug)]
pub(super) struct HeatStep {
    /// Conduction in W/K of the owned nodes whose temperature is not given; others are coupled to nothing.
    conduction: BlockRows,
    /// The positions of the diagonal entries.
    diagonal: Vec<usize>,
    /// Whether the temperature of each owned node is given, or is that of an edge.
    is_known: Vec<bool>,
    /// A factor, not yet computed, where the velocities have one and convection does not depend on time.
    factor: Option<SharedFactor>,
    solver: Option<Ksp>,
    /// The length in s of the step for which the solver is prepared.
    length: f64,
    /// Whether the temperature of some node is given, on all ranks alike.
    is_held: bool,
    /// Whether convection depends on time.
    film_varies: bool,
    conditions: Conditions,
    right_hand_side: DistributedVector,
    change: DistributedVector,
    /// Temperatures of local nodes, and powers of owned nodes.
    field: Vec<f64>,
    conducted: Vec<f64>,
    /// Heat in J that is released at the owned nodes in the step.
    released: Vec<f64>,
    /// The same that the step was expected to release.
    expected: Vec<f64>,
}

impl HeatStep {
    /// The solver for a body, if it has heat. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        preconditioner: Preconditioner,
    ) -> Result<Option<Self>> {
        let Some(heat) = &body.heat else { return Ok(None) };
        let (mesh, film_varies) = (&body.mesh, heat.has_varying_film());
        let mut known = DistributedVector::ghosted(1, mesh.owned, &mesh.ghosts)?;
        {
            let mut flags = known.owned_mut()?;
            flags
                .iter_mut()
                .zip(heat.capacity())
                .for_each(|(flag, c)| *flag = f64::from(u8::from(*c == 0.0)));
            heat.held.iter().for_each(|(node, _)| flags[*node as usize] = 1.0);
        }
        known.update_ghosts()?;
        let flags = known.local()?;
        let mut conduction = heat.conduction(session, mesh, |node| flags[node as usize] > 0.0)?;
        let mut diagonal = Vec::with_capacity(mesh.owned);
        for row in 0..mesh.owned {
            let range = conduction.offsets[row]..conduction.offsets[row + 1];
            let own = mesh.global_node(row as u32);
            for at in range.filter(|at| conduction.columns[*at] == own) {
                diagonal.push(at);
                // What is known is solved for as well, uncoupled.
                if conduction.values[at] == 0.0 {
                    conduction.values[at] = 1.0;
                }
            }
        }
        let is_known = flags[..mesh.owned].iter().map(|flag| *flag > 0.0).collect();
        drop(flags);
        Ok(Some(Self {
            conduction,
            diagonal,
            is_known,
            factor: if film_varies { None } else { preconditioner.shared_factor(session, mesh, 1)? },
            solver: None,
            length: 0.0,
            is_held: session.total(heat.held.len()) > 0,
            film_varies,
            conditions: Conditions::default(),
            right_hand_side: known.like()?,
            change: known.like()?,
            field: Vec::new(),
            conducted: Vec::new(),
            released: Vec::new(),
            expected: Vec::new(),
        }))
    }

    /// Lets the motion of a step see the temperature after this share of the step, if as much power is released as in the one before.
    /// Collective.
    pub(super) fn expect<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        step: Step,
        share: f64,
    ) -> Result<()> {
        let Body { mesh, heat: Some(heat), .. } = body else { return Ok(()) };
        if share == 0.0 {
            return heat.see(None);
        }
        let Some(power) = heat.expected() else { return Ok(()) };
        self.released.clear();
        self.released.extend(power.iter().map(|power| power * step.length));
        self.find(session, mesh, heat, step)?;
        self.expected.clone_from(&self.released);
        heat.see(Some((share, &self.change.owned()?)))
    }

    /// Finds the temperature at the end of the step just solved, over which powers of heat are constant or averages; gives the energies of
    /// heat of this rank. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        step: Step,
        averages: bool,
    ) -> Result<Energy> {
        let Body { mesh, heat: Some(heat), .. } = body else { return Ok(Energy::default()) };
        self.released.clear();
        self.released.resize(mesh.owned, 0.0);
        let [friction, flow] = heat.released(step.length, averages, &mut self.released);
        let [differs] = session.largest([f64::from(u8::from(self.released != self.expected))]);
        if differs > 0.0 {
            self.find(session, mesh, heat, step)?;
        }
        self.change.update_ghosts()?;
        self.field.clear();
        let (before, changes) = (heat.temperature(), self.change.local()?);
        self.field.extend(before.iter().zip(changes.iter()).map(|(before, change)| before + change));
        heat.conduct(mesh, &self.field, &mut self.conducted)?;
        // What enters at each node; where the temperature is given, what balances the rest.
        let Conditions { power, film, .. } = &self.conditions;
        let entered = &mut self.field;
        entered.truncate(mesh.owned);
        let flows = power.iter().zip(film);
        entered.iter_mut().zip(flows).for_each(|(t, (power, film))| *t = step.length * (power - film * *t));
        for &(node, _) in &heat.held {
            let node = node as usize;
            let taken = heat.capacity()[node] * changes[node] - self.released[node];
            entered[node] = taken + step.length * self.conducted[node];
        }
        let mut energy = Energy::default();
        let stored = heat.capacity().iter().zip(&changes[..mesh.owned]);
        energy[STORED_HEAT] = stored.map(|(capacity, change)| capacity * change).sum();
        (energy[FRICTION_HEAT], energy[FLOW_HEAT]) = (friction, flow);
        energy[ENTERED_HEAT] = entered.iter().map(|heat| heat.max(0.0)).sum();
        energy[LOST_HEAT] = entered.iter().map(|heat| (-heat).max(0.0)).sum();
        Ok(energy)
    }

    /// The heat in J that rounding errors may generate in the step just committed, from what conduction and convection passed between
    /// nodes and the boundary. Collective.
    pub(super) fn rounding<const D: usize>(&self, session: &Session, heat: &Heat<D>) -> Result<f64, Agreed> {
        let temperatures = heat.temperature_of_owned();
        let mine = || -> Result<f64> {
            let stored = heat
                .capacity()
                .iter()
                .zip(self.change.owned()?.iter())
                .map(|(c, change)| c * change.abs())
                .sum::<f64>();
            let Conditions { power, film, .. } = &self.conditions;
            let passed = (0..temperatures.len())
                .map(|node| self.conducted[node].abs() + power[node].abs() + film[node] * temperatures[node])
                .sum::<f64>();
            Ok(TOLERANCE * (stored + self.length * passed))
        };
        Ok(session.sum([session.agree(mine())?])[0])
    }

    /// Finds the changes of the temperature in a step that releases this heat. Collective.
    fn find<const D: usize>(
        &mut self,
        session: &Session,
        mesh: &Mesh<D>,
        heat: &mut Heat<D>,
        step: Step,
    ) -> Result<()> {
        heat.write_conditions(session, mesh, step.time, &mut self.conditions)?;
        self.prepare(session, heat.capacity(), step.length)?;
        // The field with the given temperatures, and its conduction.
        self.field.clear();
        self.field.extend_from_slice(heat.temperature());
        for (&(node, _), value) in heat.held.iter().zip(&self.conditions.held) {
            self.field[node as usize] = *value;
        }
        if self.is_held {
            self.change.owned_mut()?.copy_from_slice(&self.field[..mesh.owned]);
            self.change.update_ghosts()?;
            self.field.copy_from_slice(&self.change.local()?);
        }
        heat.conduct(mesh, &self.field, &mut self.conducted)?;
        let Conditions { power, film, .. } = &self.conditions;
        {
            let mut forces = self.right_hand_side.owned_mut()?;
            let before = heat.temperature();
            for (node, force) in forces.iter_mut().enumerate() {
                *force = if self.is_known[node] {
                    self.conduction.values[self.diagonal[node]] * (self.field[node] - before[node])
                } else {
                    self.released[node] / step.length + power[node]
                        - film[node] * before[node]
                        - self.conducted[node]
                };
            }
        }
        session.agree(self.find_changes())?;
        if !self.is_held {
            self.balance(session, heat.capacity(), step.length)?;
        }
        {
            let (mut changes, before) = (self.change.owned_mut()?, heat.temperature());
            for (&(node, _), value) in heat.held.iter().zip(&self.conditions.held) {
                changes[node as usize] = value - before[node as usize];
            }
        }
        Ok(heat.check(session, mesh, &self.change.owned()?)?)
    }

    /// Makes the temperature just found that of the body. Collective.
    pub(super) fn commit<const D: usize, const S: usize>(&self, body: &mut Body<D, S>) -> Result<()> {
        let Some(heat) = &mut body.heat else { return Ok(()) };
        heat.expect(self.released.iter().map(|heat| heat / self.length));
        heat.commit(&self.change.owned()?, &self.conditions.held, self.length)
    }

    /// The largest error in K of the temperature of a node in the step just solved, where it is not given, and the lowest and the highest
    /// temperature at the start and at the end of the step. Collective.
    pub(super) fn error<const D: usize>(
        &self,
        session: &Session,
        heat: &Heat<D>,
        step: Step,
    ) -> Result<TemperatureError> {
        let curvature = Curvature::of(step);
        let (change, rates) = (self.change.owned()?, heat.rate());
        let mut largest = [0.0, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for (node, (before, change)) in heat.temperature_of_owned().iter().zip(change.iter()).enumerate() {
            let last = rates.get(node).map_or(0.0, |rate| rate * step.previous_length);
            let error = if self.is_known[node] { 0.0 } else { curvature.error([*change, 0.0, -last]).abs() };
            let after = before + change;
            let found = [error, larger(-before, -after), larger(*before, after)];
            largest = std::array::from_fn(|at| larger(largest[at], found[at]));
        }
        let [error, below, highest] = session.largest(largest);
        Ok(TemperatureError { error, lowest: -below, highest })
    }

    /// Prepares the matrix of a step of this length in s, unless it is. Collective.
    fn prepare(&mut self, session: &Session, capacity: &[f64], length: f64) -> Result<()> {
        if self.solver.is_some() && self.length == length && !self.film_varies {
            return Ok(());
        }
        let Self { conduction, diagonal, is_known, conditions, factor, .. } = self;
        let mut rows = conduction.clone();
        let mut most = 0.0f64;
        for (node, &at) in diagonal.iter().enumerate() {
            if !is_known[node] {
                let others = rows.values[at] + conditions.film[node];
                most = most.max(others * length / capacity[node]);
                rows.values[at] = others + capacity[node] / length;
            }
        }
        let [most] = session.largest([most]);
        let matrix = session.agree(Matrix::symmetric(1, &rows))?;
        let mut solver = Ksp::new("heat_")?;
        solver.set_method("cg")?;
        match factor {
            Some(factor) if most >= SHORT[1] => solver.precondition_by(Box::new(factor.unfactored()))?,
            None if most >= SHORT[0] => solver.set_preconditioner("gamg", None)?,
            _ => solver.set_preconditioner("jacobi", None)?,
        }
        solver.set_tolerances(TOLERANCE, 0.0, ITERATIONS)?;
        solver.apply_options()?;
        solver.set_matrices(&matrix, &matrix)?;
        session.agree(solver.set_up())?;
        (self.solver, self.length) = (Some(solver), length);
        Ok(())
    }

    /// Shifts the solution evenly so that it takes up all heat: conduction, which passes heat on only, hides the rounding of this part where
    /// it is strong. Collective.
    fn balance(&mut self, session: &Session, capacity: &[f64], length: f64) -> Result<()> {
        let (forces, mut changes) = (self.right_hand_side.owned()?, self.change.owned_mut()?);
        let taken_per_kelvin = |node: usize| capacity[node] / length + self.conditions.film[node];
        let [mut left, mut whole] = [0.0; 2];
        for node in (0..capacity.len()).filter(|node| !self.is_known[*node]) {
            left += forces[node] - taken_per_kelvin(node) * changes[node];
            whole += taken_per_kelvin(node);
        }
        let [left, whole] = session.sum([left, whole]);
        for node in (0..capacity.len()).filter(|node| !self.is_known[*node]) {
            changes[node] += left / whole;
        }
        Ok(())
    }

    fn find_changes(&mut self) -> Result<()> {
        let Some(solver) = &mut self.solver else { return Ok(()) };
        let power = self.right_hand_side.norm()?;
        if power == 0.0 {
            return self.change.fill(0.0);
        }
        if !power.is_finite() {
            return Err(Error::Failed(
                "the heat that the step releases is not finite, because its velocities or stresses are not: use smaller steps, or \
                 scheme = \"implicit_euler\""
                    .into(),
            ));
        }
        let outcome = solver.solve(&self.right_hand_side, &mut self.change)?;
        if outcome.converged() {
            return Ok(());
        }
        Err(Error::Failed(format!(
            "the temperature at the end of the step was not found: {} after {} iterations; check that conductivity and heat capacity, \
             in SI units, have sensible values",
            outcome.description(),
            outcome.iterations
        )))
    }
}
