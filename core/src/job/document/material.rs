//! `[material]` and `[[region]]`: the materials of the body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mesh::Mesh;
use crate::job::findings::Table;
use crate::laws::material::{Damping, Hypothesis, Material, Orthotropic};

/// A part of the body with its own material. The region inherits no effect from the table `[material]`: its own table contains all
/// effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The name of the group or set of the mesh file that contains the cells of the region, or of a generated block.
    #[schemars(length(min = 1), example = &"core")]
    pub name: String,
    /// The material of the region. The hypothesis applies to the whole body and is allowed in the table `[material]` only.
    pub material: Material,
}

/// Poisson's ratio above which linear elements lock.
const LOCKING: f64 = 0.45;

/// Checks a material of the job.
pub(in crate::job) fn check_material(material: &Material, table: &mut Table<'_>, may_be_empty: bool) {
    if !may_be_empty && !material.resists() {
        let [whole, elasticity, viscosity] = ["", "elasticity", "viscosity"].map(|key| table.header(key));
        let message = format!("{whole} has no density, no elasticity and no viscosity");
        let help = match material.heat {
            None => format!("add density, {elasticity} or {viscosity}"),
            Some(_) => {
                "for heat alone add a density: a body without loads then stays at rest at no cost".into()
            }
        };
        table.fault("", message, help);
    }
    for (key, message) in material.laws_that_require_elasticity() {
        if material.orthotropic.is_some() {
            let help = format!("delete it, or replace {} by elasticity", table.header("orthotropic"));
            table.fault(key, Orthotropic::NOT_ISOTROPIC, help);
        } else if material.elasticity.is_none() {
            table.fault(key, message, format!("add {}", table.header("elasticity")));
        }
    }
    if material.orthotropic.is_some() && material.elasticity.is_some() {
        let message = "the material has two kinds of elasticity";
        table.fault_at_key("orthotropic", message, format!("delete it, or {}", table.header("elasticity")));
    }
    check_elasticity_formula(material, table);
    if material.is_damped_by_mass() && material.density.is_none() {
        table.fault("damping.mass", Damping::WITHOUT_DENSITY, format!("add {}", table.path("density")));
    }
    let is_elastic = material.elasticity.is_some() || material.orthotropic.is_some();
    let heat = material.heat.iter().flat_map(|heat| heat.faults([material.density.is_some(), is_elastic]));
    heat.for_each(|fault| table.refuse(Some(fault.within("heat"))));
    let choice = material.viscosity.iter().flat_map(|law| law.faults_of_choice());
    choice.for_each(|fault| table.refuse(Some(fault.within("viscosity"))));
    table.refuse(material.constant().fault_of_flow());
}

/// Checks a shear modulus that is a formula of the strain.
fn check_elasticity_formula(material: &Material, table: &mut Table<'_>) {
    let Some(law) = material.elasticity.as_ref().filter(|law| law.expression.is_some()) else { return };
    table.refuse(law.fault().map(|fault| fault.within("elasticity")));
    for (key, _) in material.laws_that_require_elasticity() {
        let formula = table.header("elasticity.expression");
        let message = format!("`{key}` requires linear elasticity, but {formula} is a formula of the strain");
        table.fault(key, message, format!("delete it, or {formula}"));
    }
    if material.heat.is_some_and(|heat| heat.expansion.is_some()) {
        let formula = table.header("elasticity.expression");
        let message =
            format!("thermal strain requires linear elasticity, but {formula} is a formula of the strain");
        table.fault("heat.expansion", message, format!("delete it and `reference`, or {formula}"));
    }
}

impl Region {
    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        check_material(&self.material, &mut table.table("material"), false);
        if self.material.hypothesis.is_some() {
            let message = "the hypothesis applies to the whole body";
            table.fault("material.hypothesis", message, "give it in [material] only");
        }
    }
}

/// Checks a material in a body of this dimension and hypothesis.
pub(in crate::job) fn check_in_body(
    material: &Material,
    table: &mut Table<'_>,
    (mesh, dimension, hypothesis): (&Mesh, usize, Option<Hypothesis>),
) {
    for (key, value) in material.variables() {
        table.check_flat(&key, value, dimension);
    }
    let normal_strains = if hypothesis == Some(Hypothesis::Axisymmetric) { 3 } else { dimension };
    table.refuse(material.constant().fault_of_viscosity(normal_strains));
    let orthotropic = material.orthotropic.iter().flat_map(|law| law.faults(dimension));
    orthotropic.for_each(|fault| table.refuse(Some(fault.within("orthotropic"))));
    if hypothesis == Some(Hypothesis::PlaneStress) {
        table.refuse(material.constant().fault_in_plane_stress());
    }
    if hypothesis == Some(Hypothesis::PlaneStress) || mesh.order == 2 || mesh.is_crossed() {
        return;
    }
    let path = table.path("");
    let remedy = if dimension == 2 {
        "[mesh] order = 2 does not lock, nor does a rectangle with diagonal = \"crossed\" (docs/stability.md)"
    } else {
        "[mesh] order = 2 hardly locks (docs/stability.md)"
    };
    if let Some(ratio) =
        material.elasticity.as_ref().map(|law| law.poisson_ratio).filter(|ratio| *ratio > LOCKING)
    {
        table.warn(format!(
            "{path}.elasticity.poisson_ratio = {ratio}: linear elements lock above {LOCKING}; expect displacements that are too small; \
             {remedy}"
        ));
    }
    let flow = material.viscoplasticity.as_ref();
    if flow.is_some_and(|law| law.with_yield_stress(0.0).keeps_volume()) {
        table.warn(format!(
            "{path}.viscoplasticity conserves volume: linear elements lock where they and their neighbours flow, for any Poisson's ratio; \
             expect a load capacity that is too high, by 10 to 30 % on common meshes; {remedy}"
        ));
    }
}
