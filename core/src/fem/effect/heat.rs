//! Heat: the temperature of a body, its capacity and conduction, and what passes heat at its boundary.
//!
//! The temperature is linear in cells, with its values at their corners, also where displacements are quadratic. With the capacity `C`,
//! lumped at the corners, the conduction `K` and the convection `H` of the boundary,
//!
//! ```text
//! (C / k + K + H) (T_n - T_{n-1}) = Q / k + F + H (T_a - T_{n-1}) - K T_{n-1}
//! ```
//!
//! for a step of the length `k` in which the heat `Q` is released in the body and the power `F` enters it: implicit Euler, stable for any
//! step. Lumped matrices keep the temperature between those that surround it where no angle of a cell is obtuse.

use super::{EnergyKind, History, HistoryStore, Moment, Quantity, Role, quantity};
use crate::{
    error::{Error, Result},
    fem::space::{Simplex, assemble_numbers, facet_rule},
    job::{Convection, HeatBoundary, Scalar},
    laws::material::{self, Material},
    linear_algebra::{
        petsc::{BlockRows, DistributedVector},
        tensor::{Vector, dot, larger, norm},
    },
    mesh::{
        Mesh,
        shape::{centroid, edges_of_cell, facet_normal},
    },
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

/// What is below 0 K by less than this share of the highest temperature of the body is an error of rounding or of the solution of a step.
const ROUNDING: f64 = 1e-10;

/// Heat that the body has stored since the start of the run.
pub const STORED_HEAT: EnergyKind = EnergyKind::new(
    14,
    Role::HeatSpent,
    "stored_heat",
    "with `[material.heat]`, as all columns below: heat that the body has stored since time 0",
);
/// Heat of friction that has entered the body.
pub const FRICTION_HEAT: EnergyKind = EnergyKind::new(
    17,
    Role::Heat,
    "friction_heat",
    "heat of friction that has entered the body since time 0",
);
/// Heat of viscosity and viscoplastic flow.
pub const FLOW_HEAT: EnergyKind =
    EnergyKind::new(18, Role::Heat, "flow_heat", "heat of viscosity and viscoplastic flow since time 0");
/// Work of thermal expansion on the stresses of the body.
pub const THERMAL_WORK: EnergyKind = EnergyKind::new(
    19,
    Role::Work,
    "thermal_work",
    "work of thermal expansion on the stresses of the body since time 0; part of the balance of `energy_imbalance`",
);
/// Heat that has left through the boundary.
pub const LOST_HEAT: EnergyKind =
    EnergyKind::new(15, Role::HeatSpent, "lost_heat", "heat that has left through the boundary since time 0");
/// Heat that has entered through the boundary.
pub const ENTERED_HEAT: EnergyKind = EnergyKind::new(
    16,
    Role::Heat,
    "entered_heat",
    "heat that has entered through the boundary since time 0, at each node the sum of flux, convection and what a \
     given temperature takes",
);

/// The temperature in K at the nodes.
pub const TEMPERATURE: Quantity = quantity!("temperature");
/// The temperature in K that strains the body, and that its laws see.
pub const SEEN: Quantity = quantity!("seen_temperature");

/// The temperature of a body.
#[derive(Debug)]
pub struct Heat<const D: usize> {
    /// In K at the local nodes, with ghosts up to date.
    temperature: NodalField,
    /// What motion sees of the temperature, if something does.
    seen: Option<Seen>,
    /// Powers in W of friction and of viscosity at the owned nodes at the end of the last step, where schemes average them.
    powers: Vec<NodalField>,
    /// Rate in K/s at the owned nodes in the last step, for adaptive steps.
    rate: Option<NodalField>,
    owned: usize,
    /// Whether some rank has nodes on edges.
    has_middles: bool,
    /// Capacity in J/K of the owned nodes; 0 at nodes on edges.
    capacity: Vec<f64>,
    /// Whether the flow of some material depends on the temperature.
    pub is_seen_by_flow: bool,
    /// The heat of each material.
    laws: Vec<Option<material::Heat>>,
    /// Conductivity in W/(m K) of the cells.
    conductivity: Vec<f64>,
    /// The share of the dissipation of each cell that becomes heat.
    dissipation_share: Vec<f64>,
    /// What flow takes up in each cell in the step just solved, in J; empty if no cell flows.
    flow: Vec<f64>,
    /// What is released in the step just solved.
    released: Released,
    boundaries: Vec<Boundary>,
    /// The owned nodes whose temperature is given, ascending, each with the number of the boundary that gives it.
    pub held: Vec<(u32, u32)>,
    /// Local nodes on edges, each with the ends of its edge.
    middles: Vec<[u32; 3]>,
    /// Work space for the exchange between ranks.
    exchange: DistributedVector,
    /// Work space for the convection in W/K at the local nodes; empty without convection.
    film: Vec<f64>,
}

/// Numbers at the owned nodes, and with ghosts at the local ones, that are kept from one step to the next.
#[derive(Debug)]
struct NodalField {
    quantity: Quantity,
    owned: usize,
    values: Vec<f64>,
}

/// What motion sees of the temperature.
#[derive(Debug)]
struct Seen {
    /// The temperature in K that strains the body and that its laws see: in each step the one expected where its equations hold.
    temperature: NodalField,
    /// The same before the last step that was started.
    before: Vec<f64>,
    /// Mean power in W that the last step released at the owned nodes: that expected of the next one.
    power: NodalField,
}

/// What is released in a step, at the local nodes, then at the owned ones.
#[derive(Debug, Default)]
struct Released {
    /// Power in W of friction at the end of the step.
    friction: Vec<f64>,
    /// Power in W of viscosity at the end of the step.
    viscosity: Vec<f64>,
    /// Heat in J of viscoplastic flow in the step.
    flow: Vec<f64>,
}

/// Facets of this rank through which heat passes.
#[derive(Debug)]
struct Boundary {
    given: HeatBoundary,
    facets: Vec<u32>,
}

/// What passes heat at the boundary at a time.
#[derive(Debug, Default)]
pub struct Conditions {
    /// Power in W that enters at the owned nodes, of convection that of a body of 0 K.
    pub power: Vec<f64>,
    /// Convection in W/K at the owned nodes.
    pub film: Vec<f64>,
    /// Temperatures in K of the nodes where they are given, in the order of [`Heat::held`].
    pub held: Vec<f64>,
}

impl<const D: usize> Heat<D> {
    /// The temperature of cells of these materials, given their numbers, whose boundaries are insulated; 0 K. Collective.
    pub fn new(
        mesh: &Mesh<D>,
        materials: &[Material<f64>],
        material_of: impl Fn(usize) -> usize,
    ) -> Result<Self> {
        let mut exchange = DistributedVector::ghosted(1, mesh.owned, &mesh.ghosts)?;
        let mut conductivity = Vec::with_capacity(mesh.cell_count());
        let (mut dissipation_share, mut flows) = (Vec::with_capacity(mesh.cell_count()), false);
        {
            let mut capacity = exchange.local_mut()?;
            for cell in 0..mesh.cell_count() {
                let material = &materials[material_of(cell)];
                let of_volume =
                    material.heat.and_then(|heat| heat.capacity_of(material.density)).unwrap_or(0.0);
                conductivity.push(material.heat.map_or(0.0, |heat| heat.conductivity));
                dissipation_share.push(material.heat.map_or(0.0, |heat| heat.dissipation_share));
                flows |= material.viscoplasticity.is_some();
                let (simplex, shares) = cell_of(mesh, cell);
                let whole = of_volume * simplex.volume;
                let corners = mesh.cell(cell).iter().zip(shares);
                corners.for_each(|(&node, share)| capacity[node as usize] += share * whole);
            }
        }
        exchange.add_ghosts_to_owners()?;
        let capacity = exchange.owned()?.to_vec();
        let edges = (0..mesh.cell_count()).flat_map(|cell| {
            let middles = mesh.cell_midsides(cell).iter().zip(edges_of_cell::<D>());
            middles.map(move |(&middle, ends)| {
                let [a, b] = ends.map(|end| mesh.cell(cell)[end]);
                [middle, a, b]
            })
        });
        let mut middles: Vec<[u32; 3]> = edges.collect();
        middles.sort_unstable_by_key(|[middle, ..]| *middle);
        middles.dedup_by_key(|[middle, ..]| *middle);
        Ok(Self {
            temperature: NodalField {
                quantity: TEMPERATURE,
                owned: mesh.owned,
                values: vec![0.0; mesh.nodes.len()],
            },
            seen: None,
            powers: Vec::new(),
            rate: None,
            owned: mesh.owned,
            has_middles: mesh.corner_nodes < mesh.total_nodes,
            capacity,
            is_seen_by_flow: materials
                .iter()
                .any(|material| material.viscoplasticity.as_ref().is_some_and(|law| law.sees_temperature())),
            laws: materials.iter().map(|material| material.heat).collect(),
            conductivity,
            dissipation_share,
            flow: if flows { vec![0.0; mesh.cell_count()] } else { Vec::new() },
            released: Released::default(),
            boundaries: Vec::new(),
            held: Vec::new(),
            middles,
            exchange,
            film: Vec::new(),
        })
    }

    /// Lets heat pass these facets of this rank. Collective.
    pub fn add_boundary(&mut self, mesh: &Mesh<D>, given: HeatBoundary, facets: &[u32]) -> Result<()> {
        if given.temperature.is_some() {
            self.gather(|counts| {
                let nodes = facets.iter().flat_map(|&facet| mesh.facets[facet as usize]);
                nodes.for_each(|node| counts[node as usize] += 1.0);
            })?;
            let counts = self.exchange.owned()?;
            let nodes = (0..).zip(counts.iter()).filter(|(_, count)| **count > 0.0).map(|(node, _)| node);
            let known: BTreeMap<u32, u32> = self.held.iter().copied().collect();
            let number = self.boundaries.len() as u32;
            self.held.extend(nodes.filter(|node| !known.contains_key(node)).map(|node| (node, number)));
            self.held.sort_unstable();
        }
        self.boundaries.push(Boundary { given, facets: facets.to_vec() });
        Ok(())
    }

    /// Sets the temperature of the owned nodes by their places in m. Collective.
    pub fn set(&mut self, mesh: &Mesh<D>, temperature: &Scalar) -> Result<()> {
        for (value, place) in self.temperature.values.iter_mut().zip(&mesh.nodes[..self.owned]) {
            *value = temperature.evaluate(0.0, place);
            if !is_temperature(*value) {
                return Err(Error::Refused(format!(
                    "initial.temperature is {value} at {place:?} m: temperatures are in K, not below 0; correct the expression"
                )));
            }
        }
        Ok(())
    }

    /// Makes temperatures on edges and of ghosts those of the owned corners. Collective.
    pub fn refresh(&mut self) -> Result<()> {
        let Self { temperature, seen, exchange, middles, has_middles, .. } = self;
        let middles = has_middles.then_some(&middles[..]);
        let fields = std::iter::once(temperature).chain(seen.iter_mut().map(|seen| &mut seen.temperature));
        fields.into_iter().try_for_each(|field| field.complete(middles, exchange))
    }

    /// The temperature in K at the local nodes, with ghosts.
    pub fn temperature(&self) -> &[f64] {
        &self.temperature.values
    }

    /// The temperature in K at the owned nodes.
    pub fn temperature_of_owned(&self) -> &[f64] {
        self.temperature.of_owned()
    }

    /// The capacity in J/K of the owned nodes; 0 at nodes on edges.
    pub fn capacity(&self) -> &[f64] {
        &self.capacity
    }

    /// The sums over the owned nodes of the temperature times the capacity, in J, and of the capacity, in J/K.
    pub fn heat_and_capacity(&self) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (temperature, capacity) in self.temperature_of_owned().iter().zip(self.capacity()) {
            sums[0] += temperature * capacity;
            sums[1] += capacity;
        }
        sums
    }

    /// Whether the convection depends on time.
    pub fn has_varying_film(&self) -> bool {
        let coefficients = self.boundaries.iter().filter_map(|boundary| boundary.given.convection.as_ref());
        coefficients.into_iter().any(|convection| convection.coefficient.depends_on_time())
    }

    /// The expressions at its boundaries.
    pub fn expressions(&self) -> impl Iterator<Item = &Scalar> {
        self.boundaries.iter().flat_map(|boundary| boundary.given.expressions()).map(|(_, value)| value)
    }

    /// Adds these changes of the owned nodes in K over the step just committed, of this length in s, which [`Self::check`] has accepted, and
    /// keeps its powers and rates. Nodes whose temperature is given get it without rounding. Collective.
    pub fn commit(&mut self, changes: &[f64], given: &[f64], length: f64) -> Result<()> {
        if let Some(rate) = &mut self.rate {
            rate.values.iter_mut().zip(changes).for_each(|(rate, change)| *rate = change / length);
        }
        let Released { friction, viscosity, .. } = &self.released;
        for (field, power) in self.powers.iter_mut().zip([friction, viscosity]) {
            field.values.copy_from_slice(power);
        }
        let values = &mut self.temperature.values;
        values.iter_mut().zip(changes).for_each(|(value, change)| *value = (*value + change).max(0.0));
        self.held.iter().zip(given).for_each(|(&(node, _), given)| values[node as usize] = *given);
        self.refresh()
    }

    /// Keeps the power in W at the owned nodes that the next step is expected to release, if motion sees what it does.
    pub fn expect(&mut self, power: impl Iterator<Item = f64>) {
        let Some(seen) = &mut self.seen else { return };
        seen.power.values.iter_mut().zip(power).for_each(|(expected, power)| *expected = power);
    }

    /// The power in W at the owned nodes that a step is expected to release; none where motion sees no temperature.
    pub fn expected(&self) -> Option<&[f64]> {
        self.seen.as_ref().map(|seen| &seen.power.values[..])
    }

    /// Refuses changes in K of the owned nodes that lead to what is no temperature, but for rounding errors. Collective.
    pub fn check(&self, session: &Session, mesh: &Mesh<D>, changes: &[f64]) -> Result<(), Agreed> {
        let before = self.temperature_of_owned();
        let after = || before.iter().zip(changes).map(|(value, change)| value + change);
        let [largest] = session.largest([before.iter().copied().chain(after()).fold(0.0, larger)]);
        let is_sound = |value: &f64| is_temperature(value + ROUNDING * largest);
        session.agree(match after().zip(&mesh.nodes).find(|(value, _)| !is_sound(value)) {
            None => Ok(()),
            Some((value, place)) => Err(Error::Failed(format!(
                "the temperature at the end of the step is {value} K at {place:?} m; check the fluxes of [[heat]], or use shorter steps or \
                 cells without obtuse angles. Temperatures are absolute: to count them from 0, add the same, such as 300 K, to all of them, \
                 also to `reference`"
            ))),
        })
    }

    /// The matrix of conduction in W/K, in which some local nodes are coupled to nothing, with empty rows of nodes on edges. Collective.
    pub fn conduction(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        is_known: impl Fn(u32) -> bool,
    ) -> Result<BlockRows, Agreed> {
        assemble_numbers(session, mesh, |cell, matrix| {
            let (simplex, _) = cell_of(mesh, cell);
            let (factor, nodes) = (self.conductivity[cell] * simplex.volume, mesh.cell(cell));
            for a in 0..=D {
                for b in (0..=D).filter(|&b| a == b || !(is_known(nodes[a]) || is_known(nodes[b]))) {
                    matrix[a][b] += factor * dot(&simplex.gradient(a), &simplex.gradient(b));
                }
            }
        })
    }

    /// The power in W that conduction takes from each node of a field of temperatures with ghosts: of the owned nodes, in `out`. Collective.
    pub fn conduct(&mut self, mesh: &Mesh<D>, field: &[f64], out: &mut Vec<f64>) -> Result<()> {
        let conductivity = std::mem::take(&mut self.conductivity);
        let gathered = self.gather(|powers| {
            for (cell, conductivity) in conductivity.iter().enumerate() {
                let (simplex, _) = cell_of(mesh, cell);
                let nodes = mesh.cell(cell);
                // Differences, so that no rounding errors conduct heat in a body of one temperature.
                let mut gradient = [0.0; D];
                for a in 1..=D {
                    let change = field[nodes[a] as usize] - field[nodes[0] as usize];
                    (0..D).for_each(|i| gradient[i] += change * simplex.gradients[a - 1][i]);
                }
                let factor = conductivity * simplex.volume;
                for (a, node) in nodes.iter().enumerate() {
                    powers[*node as usize] += factor * dot(&simplex.gradient(a), &gradient);
                }
            }
        });
        self.conductivity = conductivity;
        gathered?;
        out.clear();
        out.extend_from_slice(&self.exchange.owned()?);
        Ok(())
    }

    /// What passes heat at the boundary at this time in s, by quadrature of degree 2. Collective.
    pub fn write_conditions(
        &mut self,
        session: &Session,
        mesh: &Mesh<D>,
        time: f64,
        out: &mut Conditions,
    ) -> Result<()> {
        let (boundaries, mut film) = (std::mem::take(&mut self.boundaries), std::mem::take(&mut self.film));
        for values in [&mut out.power, &mut out.film] {
            values.clear();
            values.resize(self.owned, 0.0);
        }
        let mut passed = Ok(());
        if boundaries.iter().any(|boundary| boundary.given.temperature.is_none()) {
            let is_filmed = boundaries.iter().any(|boundary| boundary.given.convection.is_some());
            film.clear();
            film.resize(if is_filmed { mesh.nodes.len() } else { 0 }, 0.0);
            self.gather(|sums| passed = add_passing(&boundaries, mesh, time, [sums, &mut film]))?;
            out.power.copy_from_slice(&self.exchange.owned()?);
            if is_filmed {
                self.gather(|sums| sums.copy_from_slice(&film))?;
                out.film.copy_from_slice(&self.exchange.owned()?);
            }
        }
        (self.boundaries, self.film) = (boundaries, film);
        session.agree(passed.and_then(|()| self.write_held(mesh, time, out)))?;
        Ok(())
    }

    /// The temperatures of the nodes where they are given.
    fn write_held(&self, mesh: &Mesh<D>, time: f64, out: &mut Conditions) -> Result<()> {
        out.held.clear();
        for &(node, number) in &self.held {
            let Some(temperature) = &self.boundaries[number as usize].given.temperature else { continue };
            let place = &mesh.nodes[node as usize];
            let value = temperature.evaluate(time, place);
            if !is_temperature(value) {
                return Err(Error::Failed(format!(
                    "heat.{number}: the temperature is {value} at t = {time} s, position {place:?} m: temperatures are in K, not below \
                     0; correct the expression in the job"
                )));
            }
            out.held.push(value);
        }
        Ok(())
    }

    /// What is kept from one step to the next.
    pub fn histories(&self) -> impl Iterator<Item = &dyn HistoryStore> {
        std::iter::once(&self.temperature)
            .chain(self.seen.iter().flat_map(|seen| [&seen.temperature, &seen.power]))
            .chain(&self.powers)
            .chain(&self.rate)
            .map(|field| field as &dyn HistoryStore)
    }

    /// Visits the same.
    pub fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        visit(&mut self.temperature);
        if let Some(seen) = &mut self.seen {
            visit(&mut seen.temperature);
            visit(&mut seen.power);
        }
        self.powers.iter_mut().chain(&mut self.rate).for_each(|field| visit(field));
    }

    /// Keeps the rates of steps, for adaptive steps.
    pub fn keep_rates(&mut self) {
        self.rate = Some(NodalField::of_owned_nodes(quantity!("temperature_rate"), self.owned));
    }

    /// The rate in K/s at the owned nodes in the last step; empty where it is not kept.
    pub fn rate(&self) -> &[f64] {
        self.rate.as_ref().map_or(&[], |rate| &rate.values)
    }

    /// Keeps the powers at the end of steps, for schemes that average them.
    pub fn keep_powers(&mut self) {
        let fields = [quantity!("friction_heat_power"), quantity!("viscous_heat_power")];
        self.powers = fields.map(|quantity| NodalField::of_owned_nodes(quantity, self.owned)).into();
    }

    /// Lets motion see the temperature, now that at this time.
    pub fn show(&mut self) {
        let values = self.temperature.values.clone();
        self.seen = Some(Seen {
            temperature: NodalField { quantity: SEEN, owned: self.owned, values },
            before: Vec::new(),
            power: NodalField::of_owned_nodes(quantity!("expected_heat_power"), self.owned),
        });
    }

    /// Lets motion see the temperature of this time, or that after this share of the changes in K of the owned nodes. Collective.
    pub fn see(&mut self, expected: Option<(f64, &[f64])>) -> Result<()> {
        let Self { seen: Some(seen), temperature, exchange, middles, has_middles, .. } = self else {
            return Ok(());
        };
        std::mem::swap(&mut seen.temperature.values, &mut seen.before);
        seen.temperature.values.clone_from(&temperature.values);
        let Some((share, changes)) = expected else { return Ok(()) };
        let values = seen.temperature.values.iter_mut();
        values.zip(changes).for_each(|(value, change)| *value = (*value + share * change).max(0.0));
        seen.temperature.complete(has_middles.then_some(&middles[..]), exchange)
    }

    /// Exchanges what motion sees with what it saw before.
    pub fn see_as_before(&mut self) {
        if let Some(seen) = &mut self.seen {
            std::mem::swap(&mut seen.temperature.values, &mut seen.before);
        }
    }

    /// Whether some material expands.
    pub fn strains(&self) -> bool {
        self.laws.iter().flatten().any(|law| law.expansion.is_some())
    }

    /// Whether motion sees the temperature.
    pub fn is_seen(&self) -> bool {
        self.seen.is_some()
    }

    /// Whether that of the last step that was started differs from the one before, on this rank.
    pub fn has_changed(&self) -> bool {
        self.seen.as_ref().is_some_and(|seen| seen.temperature.values != seen.before)
    }

    /// The temperature in K at the local nodes that motion sees.
    pub fn seen(&self) -> &[f64] {
        &self.seen.as_ref().map_or(&self.temperature, |seen| &seen.temperature).values
    }

    /// The thermal strain of a cell of this material and number, at a place in barycentric coordinates.
    pub fn strain_at(&self, mesh: &Mesh<D>, (material, cell): (usize, usize), place: &[f64]) -> f64 {
        self.laws[material].map_or(0.0, |law| law.strain(self.seen_at(mesh, cell, place)))
    }

    /// The temperature in K that strains a cell of this number and that its laws see, at a place in barycentric coordinates.
    pub fn seen_at(&self, mesh: &Mesh<D>, cell: usize, place: &[f64]) -> f64 {
        let values = self.seen();
        mesh.cell(cell).iter().zip(place).map(|(node, share)| share * values[*node as usize]).sum()
    }

    /// Work space for what flow takes up in each cell in a step, in J: zeros, or empty if no cell flows.
    pub fn start_flow(&mut self) -> Vec<f64> {
        let mut flow = std::mem::take(&mut self.flow);
        flow.fill(0.0);
        flow
    }

    /// Takes back what was written there, times a factor.
    pub fn finish_flow(&mut self, mut flow: Vec<f64>, factor: f64) {
        flow.iter_mut().for_each(|energy| *energy *= factor);
        self.flow = flow;
    }

    /// Takes the heat of flow of the step just solved, and lets powers be added to it. Collective are only the calls that end with
    /// [`finish_release`](Self::finish_release).
    pub fn start_release(&mut self, mesh: &Mesh<D>) {
        let Released { friction, viscosity, flow } = &mut self.released;
        for values in [&mut *friction, &mut *viscosity, &mut *flow] {
            values.clear();
            values.resize(mesh.nodes.len(), 0.0);
        }
        let cells = self.flow.iter().zip(&self.dissipation_share).enumerate();
        for (cell, (energy, share)) in cells.filter(|(_, (energy, _))| **energy != 0.0) {
            add_to_corners(mesh, cell, share * energy, flow);
        }
    }

    /// Adds a power of friction in W at a local node.
    pub fn add_friction(&mut self, node: usize, power: f64) {
        self.released.friction[node] += power;
    }

    /// Adds a power of viscosity in W in a cell.
    pub fn add_viscosity(&mut self, mesh: &Mesh<D>, cell: usize, power: f64) {
        let share = self.dissipation_share[cell];
        add_to_corners(mesh, cell, share * power, &mut self.released.viscosity);
    }

    /// Sums what was added over the ranks, at the owned corners of cells. Collective.
    pub fn finish_release(&mut self) -> Result<()> {
        let mut released = std::mem::take(&mut self.released);
        for (values, is_at_nodes) in
            [(&mut released.friction, true), (&mut released.viscosity, false), (&mut released.flow, false)]
        {
            self.gather(|sums| sums.copy_from_slice(values))?;
            if self.has_middles && is_at_nodes {
                self.share_middles(values)?;
            }
            values.clear();
            values.extend_from_slice(&self.exchange.owned()?);
        }
        self.released = released;
        Ok(())
    }

    /// Passes what owned nodes on edges have in the exchange on to the ends of their edges. `values` is work space. Collective.
    fn share_middles(&mut self, values: &mut [f64]) -> Result<()> {
        let owned = self.owned;
        values.fill(0.0);
        values[..owned].copy_from_slice(&self.exchange.owned()?);
        for &[middle, a, b] in self.middles.iter().filter(|[middle, ..]| (*middle as usize) < owned) {
            let half = 0.5 * std::mem::take(&mut values[middle as usize]);
            values[a as usize] += half;
            values[b as usize] += half;
        }
        self.gather(|sums| sums.copy_from_slice(values))
    }

    /// The heat in J that is released at the owned nodes in the step just solved of this length in s, added to `sum`, and that of
    /// friction and of flow on this rank. Under a formula of second order powers are means over the step.
    pub fn released(&self, length: f64, averages: bool, sum: &mut [f64]) -> [f64; 2] {
        let Released { friction, viscosity, flow } = &self.released;
        let mut totals = [0.0; 2];
        for (kind, power) in [friction, viscosity].into_iter().enumerate() {
            let before = self.powers.get(kind).filter(|_| averages).map(|field| &field.values);
            for (node, (sum, power)) in sum.iter_mut().zip(power).enumerate() {
                let mean = before.map_or(*power, |before| 0.5 * (before[node] + power));
                *sum += length * mean;
                totals[kind] += length * mean;
            }
        }
        for (sum, heat) in sum.iter_mut().zip(flow) {
            *sum += heat;
            totals[1] += heat;
        }
        totals
    }

    /// Sums contributions to the local nodes, which `add` writes, at the owned nodes of the exchange. Collective.
    fn gather(&mut self, add: impl FnOnce(&mut [f64])) -> Result<()> {
        {
            let mut values = self.exchange.local_mut()?;
            values.fill(0.0);
            add(&mut values);
        }
        self.exchange.add_ghosts_to_owners()
    }
}

/// The words for a coefficient of heat transfer, which is not negative.
const COEFFICIENT: &str = "coefficient of heat transfer";
const FLUX: &str = "flux";

/// Whether a number is a temperature in K.
fn is_temperature(number: f64) -> bool {
    number >= 0.0 && number.is_finite()
}

impl NodalField {
    /// Zeros at the owned nodes.
    fn of_owned_nodes(quantity: Quantity, owned: usize) -> Self {
        Self { quantity, owned, values: vec![0.0; owned] }
    }

    fn of_owned(&self) -> &[f64] {
        &self.values[..self.owned]
    }

    /// Makes the values of ghosts those of their owners and, of cells with nodes on edges, those there the means of the ends. Collective.
    fn complete(&mut self, middles: Option<&[[u32; 3]]>, exchange: &mut DistributedVector) -> Result<()> {
        self.update_ghosts(exchange)?;
        let Some(middles) = middles else { return Ok(()) };
        for [middle, a, b] in middles.iter().map(|nodes| nodes.map(|node| node as usize)) {
            self.values[middle] = 0.5 * (self.values[a] + self.values[b]);
        }
        // Ghosts on edges need not belong to a cell of this rank.
        self.update_ghosts(exchange)
    }

    /// Makes the values of ghosts those of their owners. Collective.
    fn update_ghosts(&mut self, exchange: &mut DistributedVector) -> Result<()> {
        exchange.owned_mut()?.copy_from_slice(self.of_owned());
        exchange.update_ghosts()?;
        self.values.copy_from_slice(&exchange.local()?);
        Ok(())
    }
}

impl HistoryStore for NodalField {
    fn values(&self, moment: Moment) -> Option<History<'_>> {
        let values = moment.of(self.of_owned(), None)?.iter().copied().enumerate();
        Some(History::of_nodes((self.quantity, moment), self.owned, values))
    }

    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        if quantity == self.quantity && moment == Moment::Last {
            self.values[..self.owned].copy_from_slice(values);
        }
    }
}

/// The linear cell of the corners of a cell, of a body of revolution with the volume of its ring, and the shares of the volume that the
/// functions of the corners have.
fn cell_of<const D: usize>(mesh: &Mesh<D>, cell: usize) -> (Simplex<D>, [f64; 4]) {
    let corners = &mesh.corners(cell)[..=D];
    let simplex = Simplex::new(corners);
    if !mesh.is_revolved {
        return (simplex, [1.0 / (D + 1) as f64; 4]);
    }
    let sum: f64 = corners.iter().map(|corner| corner[0]).sum();
    let shares = std::array::from_fn(|a| corners.get(a).map_or(0.0, |corner| 0.25 * (1.0 + corner[0] / sum)));
    (Simplex { volume: mesh.turn(&centroid(corners)) * simplex.volume, ..simplex }, shares)
}

/// Adds a part of a cell to its corners.
fn add_to_corners<const D: usize>(mesh: &Mesh<D>, cell: usize, whole: f64, sums: &mut [f64]) {
    let (_, shares) = cell_of(mesh, cell);
    mesh.cell(cell).iter().zip(shares).for_each(|(node, share)| sums[*node as usize] += share * whole);
}

/// Adds to the nodes of this rank the power in W that enters, of convection that of a body of 0 K, and the convection in W/K.
fn add_passing<const D: usize>(
    boundaries: &[Boundary],
    mesh: &Mesh<D>,
    time: f64,
    [power, film]: [&mut [f64]; 2],
) -> Result<()> {
    for (number, Boundary { given, facets }) in boundaries.iter().enumerate() {
        let value = |value: &Scalar, what: &str, place: &Vector<D>| {
            let number_there = value.evaluate(time, place);
            let is_sound = is_temperature(number_there) || (what == FLUX && number_there.is_finite());
            let fault = || {
                Error::Failed(format!(
                    "heat.{number}: the {what} is {number_there} at t = {time} s, position {place:?} m; only a flux may be \
                     negative: correct the expression in the job"
                ))
            };
            is_sound.then_some(number_there).ok_or_else(fault)
        };
        for &facet in facets.iter().filter(|_| given.temperature.is_none()) {
            for (weight, shares, place) in points_of_facet(mesh, facet) {
                let nodes = || mesh.facets[facet as usize].iter().zip(shares);
                if let Some(Convection { coefficient, ambient }) = &given.convection {
                    let coefficient = value(coefficient, COEFFICIENT, &place)?;
                    let whole = weight * coefficient;
                    nodes().for_each(|(node, share)| film[*node as usize] += share * whole);
                    let whole = weight * (coefficient * value(ambient, "ambient temperature", &place)?);
                    nodes().for_each(|(node, share)| power[*node as usize] += share * whole);
                } else if let Some(flux) = &given.flux {
                    let whole = weight * value(flux, FLUX, &place)?;
                    nodes().for_each(|(node, share)| power[*node as usize] += share * whole);
                }
            }
        }
    }
    Ok(())
}

/// The Gauss points of a facet between its corners: the weight in m^(D-1), the values of the functions of the corners, the place in m.
fn points_of_facet<const D: usize>(
    mesh: &Mesh<D>,
    facet: u32,
) -> impl Iterator<Item = (f64, &'static [f64; 3], Vector<D>)> {
    let corners = mesh.facet_corners(facet);
    let measure = norm(&facet_normal(&corners));
    facet_rule::<D>().iter().map(move |(shares, weight)| {
        let place = std::array::from_fn(|i| corners.iter().zip(shares).map(|(c, share)| share * c[i]).sum());
        (measure * weight * mesh.turn(&place), shares, place)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::space::samples::{revolved, row};

    #[test]
    fn shares_of_a_ring_are_those_of_its_volume_and_its_faces() {
        let mut mesh: Mesh<2> = revolved(row());
        mesh.facets = (0..mesh.cell_count()).map(|cell| [mesh.cell(cell)[0], mesh.cell(cell)[1]]).collect();
        for cell in 0..mesh.cell_count() {
            let (ring, shares) = cell_of(&mesh, cell);
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            // The moment of the section about the axis: exact for a function that is linear.
            let corners = &mesh.corners(cell)[..3];
            let area = Simplex::new(corners).volume;
            let squares: f64 = corners.iter().map(|c| c[0] * c[0]).sum();
            let sum: f64 = corners.iter().map(|c| c[0]).sum();
            let expected = std::f64::consts::TAU * area * (squares + sum * sum) / 12.0;
            let found: f64 = corners.iter().zip(shares).map(|(c, share)| ring.volume * share * c[0]).sum();
            assert!((found - expected).abs() < 1e-13 * expected.abs(), "{found} {expected}");
        }
        for facet in 0..mesh.facets.len() as u32 {
            let [a, b] = mesh.facet_corners(facet);
            let length = norm(&[b[0] - a[0], b[1] - a[1]]);
            let total: f64 = points_of_facet(&mesh, facet).map(|(weight, ..)| weight).sum();
            let expected = std::f64::consts::PI * length * (a[0] + b[0]);
            assert!((total - expected).abs() <= 1e-13 * expected, "{total} {expected}");
        }
    }
}
