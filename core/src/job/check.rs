//! Checks of a job: each table by itself, and tables that refer to each other.

use super::document::{
    Contact, Job, Method, check_contact, check_contact_names, check_material, check_material_in_body,
};
use super::findings::{MeshNames, Table, number_of_group};
use crate::laws::contact::{Gap, Side};
use crate::laws::expression::Scalar;
use crate::laws::law::header;
use crate::laws::material::{Hypothesis, Material};

impl Job {
    /// All materials with their paths: the main one, then those of the regions.
    pub fn materials(&self) -> impl Iterator<Item = (String, &Material)> {
        let regions = self.region.iter().enumerate();
        let regions = regions.map(|(index, region)| (format!("region.{index}.material"), &region.material));
        std::iter::once(("material".to_owned(), &self.material)).chain(regions)
    }

    /// Whether its materials have heat.
    pub fn has_heat(&self) -> bool {
        self.materials().any(|(_, material)| material.heat.is_some())
    }

    /// Whether the motion depends on the temperature, by thermal strain or by a law.
    pub fn sees_temperature(&self) -> bool {
        let expands = |material: &Material| {
            material.heat.as_ref().and_then(|heat| heat.expansion).is_some_and(|expansion| expansion != 0.0)
        };
        let flows =
            |material: &Material| material.viscoplasticity.as_ref().is_some_and(|law| law.sees_temperature());
        let slides = |contact: &Contact| contact.friction.as_ref().is_some_and(|law| law.sees_temperature());
        self.materials().any(|(_, material)| expands(material) || flows(material))
            || self.contact.iter().any(slides)
    }

    /// The order at which displacements, velocities and stresses converge with the step, where they are smooth: that of the scheme, but 1
    /// where they depend on the temperature, whose steps are those of implicit Euler under every scheme.
    pub fn order_in_time(&self) -> u32 {
        if self.sees_temperature() { 1 } else { self.time.scheme.order() }
    }

    /// The material of the cells of a region of the mesh.
    pub fn material_of(&self, region: &str) -> &Material {
        self.region.iter().find(|named| named.name == region).map_or(&self.material, |named| &named.material)
    }
}

/// All checks that are possible before a mesh file is read.
pub(super) fn check(job: &Job, table: &mut Table<'_>) {
    check_material(&job.material, &mut table.table("material"), !job.region.is_empty());
    table.each("region", &job.region, |region, table| region.check(table));
    let names = job.region.iter().map(|region| &*region.name);
    table.refuse_same(("region", "name"), names, ["regions have the name", "give each region its own name"]);
    table.each("support", &job.support, |support, table| support.check(table));
    check_claims(job, table);
    table.each("traction", &job.traction, |traction, table| traction.check(table));
    check_density_and_elasticity(job, table);
    check_heat(job, table);
    if let Some(initial) = &job.initial {
        initial.check(&mut table.table("initial"));
    }
    check_method(job, table);
    check_strengths(job, table);
    table.each("contact", &job.contact, |contact, table| check_contact(contact, table, job.time.scheme));
    job.time.check(&mut table.table("time"));
    if let Some(checkpoint) = &job.checkpoint {
        checkpoint.check(&mut table.table("checkpoint"), job.time.end);
    }
    check_extrapolation(job, table);
    job.solver.check(&mut table.table("solver"));
    job.output.check(&mut table.table("output"), job.time.end);
    check_flow_that_is_written(job, table);
    check_expected(job, table);
    job.mesh.check_placement(&mut table.table("mesh"));
    if let Some(dimension) = job.dimension() {
        job.mesh.check(&mut table.table("mesh"));
        let names = job.mesh.names();
        let [boundaries, regions] =
            names.each_ref().map(|names| names.iter().map(String::as_str).collect::<Vec<_>>());
        let (boundaries, regions) = (&*boundaries, &*regions);
        check_names(job, table, MeshNames { dimension, boundaries, regions, points: &[], inner: &[] });
    }
}

/// The checks that need the dimension and the names of the mesh.
pub(super) fn check_names(job: &Job, table: &mut Table<'_>, mesh: MeshNames<'_>) {
    check_hypothesis(job, table, mesh.dimension);
    each_material(job, table, |material, table| {
        check_material_in_body(material, table, (&job.mesh, mesh.dimension, job.material.hypothesis));
    });
    check_regions(job, table, mesh);
    table.each("support", &job.support, |support, table| support.check_names(table, mesh));
    table.each("traction", &job.traction, |traction, table| traction.check_names(table, mesh));
    table.each("heat", &job.heat, |heat, table| heat.check_names(table, mesh));
    table.each("contact", &job.contact, |contact, table| check_contact_names(contact, table, mesh));
    table.each("body_force", &job.body_force, |force, table| {
        table.check_vector("value", &force.value, mesh.dimension);
    });
    if let Some(gravity) = &job.gravity {
        table.check_vector("gravity.acceleration", &gravity.acceleration, mesh.dimension);
    }
    if let Some(initial) = &job.initial {
        initial.check_in_body(&mut table.table("initial"), (mesh.dimension, job.material.hypothesis));
    }
    job.output.check_names(&mut table.table("output"), mesh, &job.mesh.blocks());
    warn_of_inner_facets(job, table, mesh);
}

fn check_hypothesis(job: &Job, table: &mut Table<'_>, dimension: usize) {
    let is_given = job.material.hypothesis.is_some();
    if dimension == 2 && !is_given {
        let help = "add hypothesis = \"plane_stress\", \"plane_strain\" or \"axisymmetric\" to [material]";
        table.fault("material", "a 2D body needs a hypothesis", help);
    }
    if dimension == 3 && is_given {
        table.fault("material.hypothesis", "a 3D body has no hypothesis", "delete this line");
    }
    if job.is_revolved() {
        check_revolved(job, table);
    }
}

/// Checks the table of each material.
fn each_material(job: &Job, table: &mut Table<'_>, mut check: impl FnMut(&Material, &mut Table<'_>)) {
    job.materials().for_each(|(path, material)| check(material, &mut table.table(&path)));
}

/// Whether this is 0 always and everywhere.
fn is_zero(value: &Scalar) -> bool {
    !value.depends_on_time() && !value.depends_on_position() && value.evaluate(0.0, &[]) == 0.0
}

/// What acts on a body of revolution acts in its section, and all around alike.
fn check_revolved(job: &Job, table: &mut Table<'_>) {
    if job.gravity.as_ref().and_then(|gravity| gravity.acceleration.first()).is_some_and(|x| !is_zero(x)) {
        let message = "the weight of a body of revolution acts along its axis, y";
        table.fault("gravity.acceleration", message, "give 0 as the first component");
    }
    table.each("contact", &job.contact, |contact, table| {
        let turning = "an obstacle beside a body of revolution does not turn in its section";
        if let Some(key) = contact.obstacle.as_ref().and_then(Gap::rotation_key) {
            table.fault(&key, turning, "delete this key");
        }
        let Some(load) = &contact.obstacle_load else { return };
        if load.direction.first().is_some_and(|x| *x != 0.0) {
            let help = "give a direction along the axis, such as [0, -1]";
            let message = "an obstacle beside a body of revolution is moved along the axis, y";
            table.fault("obstacle_load.direction", message, help);
        }
        if load.moment.is_some() {
            table.fault("obstacle_load.moment", turning, "delete this key");
        }
    });
}

/// In plane stress the strain across the plane is known of flow that keeps the volume.
fn check_flow_that_is_written(job: &Job, table: &mut Table<'_>) {
    if job.material.hypothesis != Some(Hypothesis::PlaneStress) || !job.output.asks_for_flow() {
        return;
    }
    each_material(job, table, |material, table| {
        let flow = material.viscoplasticity.as_ref();
        if flow.is_some_and(|law| !law.with_yield_stress(0.0).keeps_volume()) {
            let message = "the equivalent viscoplastic strain in plane stress is known of flow that keeps the volume only";
            let help = "use plane strain, or delete \"equivalent_viscoplastic_strain\" in [output]";
            table.fault("viscoplasticity", message, help);
        }
    });
}

/// Regions are those of the mesh. Cells of others have the main material, which may be empty only if there are none.
fn check_regions(job: &Job, table: &mut Table<'_>, mesh: MeshNames<'_>) {
    table.each("region", &job.region, |region, table| {
        table.check_name("name", &region.name, mesh.regions, "region");
    });
    let other = mesh.regions.iter().find(|name| !job.region.iter().any(|region| region.name == **name));
    if let Some(other) = other.filter(|_| !job.region.is_empty() && !job.material.resists()) {
        let message = format!(
            "the region \"{other}\" of the mesh has the material of [material], which has no density, no elasticity and no viscosity"
        );
        let help = "add density, elasticity or viscosity, or a [[region]] for it";
        table.fault("material", message, help);
    }
}

/// A boundary without free components cannot have a contact, and a boundary may occur in one contact table only.
fn check_claims(job: &Job, table: &mut Table<'_>) {
    let dimension = job.dimension().unwrap_or(3);
    let holds = |name: &String| {
        job.support.iter().any(|support| support.on.contains(name) && support.holds_all(dimension))
    };
    let any_held = |names: &[String]| names.iter().any(holds);
    for (number, contact) in job.contact.iter().enumerate() {
        // The side that carries the law.
        let carries = contact.against.is_empty()
            || match contact.side {
                Side::On => true,
                Side::Against => false,
                Side::Auto => any_held(&contact.against),
            };
        let is_rival = |other: &&Contact| contact.part.is_none() || other.part.is_none();
        let taken = |name| job.contact[..number].iter().filter(is_rival).any(|other| other.on.contains(name));
        for (index, name) in contact.on.iter().enumerate() {
            let path = format!("contact.{number}.on.{index}");
            if carries && holds(name) {
                let message =
                    format!("the boundary \"{name}\" has a contact, but a support fixes all its components");
                table.fault(&path, message, "remove it from one of the two tables");
            }
            if taken(name) {
                let message = format!("the boundary \"{name}\" is in two [[contact]] tables");
                let help = "a boundary has one contact law: remove it from one of them, or give each its part by `where`";
                table.fault(&path, message, help);
            }
        }
    }
    for (number, contact) in job.contact.iter().enumerate() {
        let has = |names: &[String], all: &[String]| names.iter().any(|name| all.contains(name));
        let is_reverse = |other: &Contact| {
            (contact.part.is_none() || other.part.is_none())
                && has(&contact.on, &other.against)
                && has(&contact.against, &other.on)
        };
        if let Some(earlier) = job.contact[..number].iter().position(is_reverse) {
            let path = format!("contact.{number}.against");
            let help = "a pair of boundaries has one contact law: delete one of the tables, or give each its part by `where`";
            table.fault(&path, format!("these boundaries face each other in contact.{earlier}, too"), help);
        }
    }
    for (number, traction) in job.traction.iter().enumerate() {
        for (index, name) in traction.on.iter().enumerate().filter(|(_, name)| holds(name)) {
            table.warn(format!(
                "traction.{number}.on.{index}: a support fixes all components on \"{name}\"; the traction has no effect"
            ));
        }
    }
}

/// Gravity acts on materials with a density, an initial stress and the error indicator require elasticity.
fn check_density_and_elasticity(job: &Job, table: &mut Table<'_>) {
    if job.gravity.is_some() && job.materials().all(|(_, material)| material.density.is_none()) {
        let message = "gravity requires a material with a density, but no material has one";
        let help = "give [material] density; for a body without inertia, write the weight as [[body_force]]";
        table.fault_at_key("gravity", message, help);
    }
    let initial_velocity = job.initial.as_ref().and_then(|initial| initial.velocity.as_ref());
    if initial_velocity.is_some_and(|velocity| !velocity.iter().all(is_zero))
        && job.materials().all(|(_, material)| material.density.is_none())
    {
        table.warn(
            "initial.velocity has no effect: no material has a density, and without inertia the forces of a step alone determine its \
             velocity; add density, or delete it"
                .into(),
        );
    }
    let has_stress = job.initial.as_ref().is_some_and(|initial| initial.stress.is_some());
    if has_stress && job.materials().all(|(_, material)| material.elasticity.is_none()) {
        let message = "an initial stress requires an elastic material";
        table.fault_at_key("initial.stress", message, "add [material.elasticity]");
    }
    if has_stress
        && let Some((path, _)) = job.materials().find(|(_, material)| material.orthotropic.is_some())
    {
        let message = "an initial stress requires isotropic elasticity";
        let help = format!("delete it, or replace {} by elasticity", header(&format!("{path}.orthotropic")));
        table.fault_at_key("initial.stress", message, help);
    }
    check_formulas_of_strain(job, table, has_stress);
    let has_back_stress = |material: &Material| {
        material.viscoplasticity.as_ref().is_some_and(|law| law.with_yield_stress(0.0).has_back_stress())
    };
    if has_stress && job.materials().any(|(_, material)| has_back_stress(material)) {
        let message = "kinematic hardening follows from the stress that flow leaves, to which an initial stress would add";
        table.fault_at_key("initial.stress", message, "delete it, or `kinematic_modulus`");
    }
    let rigid = job.materials().filter(|(_, material)| material.elasticity.is_none());
    for (path, _) in rigid.filter(|_| job.output.error_indicator) {
        let elasticity = header(&format!("{path}.elasticity"));
        let region =
            job.region.iter().enumerate().find(|(index, _)| path == format!("region.{index}.material"));
        let whose = region.map_or(String::new(), |(_, region)| format!(" of region \"{}\"", region.name));
        let message = format!("the error indicator needs {elasticity}{whose}");
        let help =
            "it measures stress errors in the elastic energy norm: add elasticity, or delete error_indicator";
        table.fault("output.error_indicator", message, help);
    }
}

/// What a shear modulus that is a formula of the strain excludes.
fn check_formulas_of_strain(job: &Job, table: &mut Table<'_>, has_initial_stress: bool) {
    let has_formula =
        |material: &Material| material.elasticity.as_ref().is_some_and(|law| law.expression.is_some());
    let Some((path, _)) = job.materials().find(|(_, material)| has_formula(material)) else { return };
    let formula = header(&format!("{path}.elasticity.expression"));
    if !job.time.scheme.is_implicit() {
        for (path, material) in job.materials() {
            let law = material.elasticity.as_ref().and_then(|law| law.expression.as_ref());
            let fault = law.and_then(|law| law.fault_of_explicit_steps());
            table.refuse(fault.map(|fault| fault.within("elasticity.expression").within(&path)));
        }
    }
    if has_initial_stress {
        let message =
            format!("an initial stress requires linear elasticity, but {formula} is a formula of the strain");
        table.fault_at_key("initial.stress", message, format!("delete it, or {formula}"));
    }
    if job.output.error_indicator {
        let message = format!(
            "the error indicator measures stress in the norm of linear elasticity, but {formula} is a formula"
        );
        table.fault("output.error_indicator", message, format!("delete it, or {formula}"));
    }
    let formulas =
        job.materials().filter_map(|(_, material)| material.elasticity.as_ref()?.expression.as_ref());
    let at_rest: Vec<f64> =
        formulas.map(|formula| formula.at_rest()).filter(|factor| *factor != 1.0).collect();
    let absorbing = job.support.iter().position(|support| support.absorbing);
    if let (Some(number), Some(factor)) = (absorbing, at_rest.first()) {
        let message = format!(
            "an absorbing support has the wave speeds of youngs_modulus and poisson_ratio, but {formula} multiplies the shear modulus by \
             {factor} without strain"
        );
        let help =
            "let shear_factor be 1 at e = 0, and youngs_modulus and poisson_ratio those of small strains";
        table.fault_at_key(&format!("support.{number}.absorbing"), message, help);
    }
}

/// Flow heats the body by what it dissipates, and is as fast as the temperature has it, where this is known.
fn check_heat_of_flow(job: &Job, table: &mut Table<'_>) {
    let mut unbounded = Vec::new();
    each_material(job, table, |material, table| {
        let Some(law) = &material.viscoplasticity else { return };
        let heats = material.heat.is_some_and(|heat| heat.dissipation_share > 0.0);
        if heats && law.with_yield_stress(0.0).has_back_stress() {
            let message = "kinematic hardening stores part of the work of flow and gives it back, which is not told from heat";
            let heat = table.header("heat");
            table.fault(
                "heat",
                message,
                format!("set dissipation_share = 0 in {heat}, or delete `kinematic_modulus`"),
            );
        }
        unbounded.extend(law.sees_temperature().then(|| table.header("viscoplasticity.expression")));
    });
    for formula in unbounded.iter().filter(|_| !job.time.scheme.is_implicit()) {
        let message = format!(
            "no bound of the step is known with scheme \"{}\" for {formula}, which depends on the temperature",
            job.time.scheme.name()
        );
        table.fault("time.scheme", message, "use \"implicit_euler\", \"bdf2\" or \"midpoint\"");
    }
}

/// Friction that has to do with heat, in a body with heat or without.
fn check_heat_of_contact(contact: &Contact, table: &mut Table<'_>, body_has_heat: bool) {
    if let Some(law) = contact.friction.as_ref().filter(|law| law.sees_temperature() && !body_has_heat) {
        let message = "the coefficient contains the temperature, which this body does not have";
        let help = "add [material.heat], or delete `temperature` from the formula";
        table.fault(law.table(), message, help);
    }
    let (lacks, needed) = match contact.friction {
        _ if !body_has_heat => ("a material with heat", "[material.heat]"),
        None => ("friction", "[contact.friction]"),
        Some(_) => return,
    };
    if contact.friction_heat.is_some() {
        let message = format!("a share of the heat of friction requires {lacks}");
        table.fault_at_key("friction_heat", message, format!("add {needed}, or delete it"));
    }
}

/// Heat is in all materials or in none, and has an initial temperature; without it nothing else has to do with temperature.
fn check_heat(job: &Job, table: &mut Table<'_>) {
    table.each("heat", &job.heat, |heat, table| heat.check(table));
    let has_heat = |material: &Material| material.heat.is_some();
    let initial = job.initial.as_ref();
    let temperature = initial.and_then(|initial| initial.temperature.as_ref());
    each_material(job, table, |material, table| {
        if !has_heat(material) && material.viscoplasticity.as_ref().is_some_and(|law| law.sees_temperature())
        {
            let message = "the rate contains the temperature, which this material does not have";
            let help = format!("add {}, or delete `temperature` from the formula", table.header("heat"));
            table.fault("viscoplasticity.expression.rate", message, help);
        }
    });
    table.each("contact", &job.contact, |contact, table| {
        check_heat_of_contact(contact, table, job.has_heat());
    });
    if !job.has_heat() {
        let help = "add [material.heat], or delete it";
        if !job.heat.is_empty() {
            table.fault_at_key("heat", "heat at a boundary requires a material with heat", help);
        }
        if temperature.is_some() {
            let message = "an initial temperature requires a material with heat";
            table.fault_at_key("initial.temperature", message, help);
        }
        return;
    }
    check_heat_of_flow(job, table);
    each_material(job, table, |material, table| {
        if material.resists() && !has_heat(material) {
            let message = format!("{} has no heat, which other materials have", table.header(""));
            let help = format!("add {}: the temperature is a field of the whole body", table.header("heat"));
            table.fault("", message, help);
        }
    });
    if temperature.is_none() && initial.is_none_or(|initial| initial.from.is_none()) {
        let key = if initial.is_some() { "initial" } else { "material.heat" };
        table.fault(key, "a body with heat has no initial temperature", "add [initial] temperature = 293.0");
    }
}

/// PETSc's solver for variational inequalities supports bounds only.
fn check_method(job: &Job, table: &mut Table<'_>) {
    let has_bounds =
        job.contact.iter().all(|contact| contact.normal.is_bound() && contact.friction.is_none());
    if job.solver.method == Method::Vinewtonrsls && (job.contact.is_empty() || !has_bounds) {
        let message = "this method requires that every contact is frictionless and `unilateral`";
        table.fault("solver.method", message, "use \"newton\", or delete the key");
    }
}

/// Where boundaries meet, the bonds of a node break together: by one rule.
fn check_strengths(job: &Job, table: &mut Table<'_>) {
    let has_strength = |contact: &Contact| Some(contact.adhesion?.strength.is_some());
    let first = job.contact.iter().find_map(has_strength);
    table.each("contact", &job.contact, |contact, table| {
        if has_strength(contact).is_some_and(|has_strength| Some(has_strength) != first) {
            let message = "either all adhesion tables of a job have a `strength` or none has";
            let help = "give all of them a strength, or delete the key everywhere";
            table.fault_at_key("adhesion", message, help);
        }
    });
}

/// If the end of a step is extrapolated, what cannot be is refused: histories that change in one direction only, and velocities that jump.
fn check_extrapolation(job: &Job, table: &mut Table<'_>) {
    let scheme = job.time.scheme;
    if !scheme.extrapolates() {
        return;
    }
    let refuse = |table: &mut Table<'_>, key: &str, is_there: bool| {
        if is_there {
            let message = format!("`{}` is not available with scheme \"{}\"", table.path(key), scheme.name());
            table.fault_at_key(key, message, "use [time] scheme = \"bdf2\", or delete the key");
        }
    };
    each_material(job, table, |material, table| refuse(table, "damage", material.damage.is_some()));
    table.each("contact", &job.contact, |contact, table| {
        refuse(table, "adhesion", contact.adhesion.is_some());
        refuse(table, "memory", contact.memory.is_some());
        if !contact.redistribute_mass {
            let scheme = scheme.name();
            let message = format!(
                "with scheme \"{scheme}\" nodes with mass would rebound from the obstacle in each step"
            );
            table.fault_at_key("", message, "add redistribute_mass = true, or use another scheme");
        }
    });
    table.each("support", &job.support, |support, table| {
        support.motions().for_each(|(key, _)| refuse(table, key, true));
    });
    refuse(table, "time.adaptive", job.time.adaptive.is_some());
}

/// An expected result has a tolerance.
fn check_expected(job: &Job, table: &mut Table<'_>) {
    for (quantity, expected) in &job.check {
        if expected.relative.is_none() && expected.absolute.is_none() {
            let message = format!("\"{quantity}\" has no tolerance");
            let help = "add relative = 1e-6, or absolute in the quantity's own unit";
            table.fault_at_name(("check", quantity), message, help);
        }
    }
}

/// Physical groups of facets inside the body that no table names are ignored.
fn warn_of_inner_facets(job: &Job, table: &mut Table<'_>, mesh: MeshNames<'_>) {
    let lists = job.support.iter().map(|support| &support.on);
    let lists = lists.chain(job.traction.iter().map(|traction| &traction.on));
    let lists = lists.chain(job.heat.iter().map(|heat| &heat.on));
    let lists = lists.chain(job.contact.iter().map(|contact| &contact.on));
    let profiles = job.output.profile.iter().map(|profile| &profile.on);
    let named: Vec<&String> = lists.flatten().chain(profiles).collect();
    for [name, place] in mesh.inner {
        let is_named = |other: &&String| *other == name || number_of_group(other) == Some(name);
        if mesh.points.contains(name) || !named.iter().any(is_named) {
            table.warn(format!(
                "the group \"{name}\" has facets inside the body, for example around {place}: it is not a boundary, and is ignored"
            ));
        }
    }
}
