//! The temperature of bodies against closed forms, and the balance of heat.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::{
    fem::effect::{
        CONTACT, ELASTIC, ENTERED_HEAT, FLOW_HEAT, FRICTION_HEAT, NUMERICAL, STORED_HEAT, THERMAL_WORK,
        VISCOPLASTIC, VISCOUS,
    },
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};
use std::f64::consts::PI;

/// A body with heat that nothing moves, with these steps, [material.heat] of conductivity 2 W/(m K) and 3 J/(m^d K), and these tables.
fn still<const D: usize>(hypothesis: &str, [end, step]: [f64; 2], tables: &str) -> String {
    let hypothesis = if D == 2 { format!("hypothesis = \"{hypothesis}\"\n") } else { String::new() };
    format!(
        "{}[material]\n{hypothesis}elasticity = {{ youngs_modulus = 50, poisson_ratio = 0.3 }}\n\
         heat = {{ conductivity = 2, volumetric_capacity = 3 }}\n\
         [[support]]\non = [\"left\", \"right\", \"top\", \"bottom\"]\nfix = \"all\"\n\
         [time]\nend = {end}\nstep = {step}\nscheme = \"implicit_euler\"\n{tables}",
        any_mesh::<D>()
    )
}

/// The same job with a mesh that has regions of its own.
fn unknown_mesh(job: &str) -> String {
    let job = job.replace(any_mesh::<2>(), "");
    if job.contains("[mesh]") {
        job.replace("[mesh]", "[mesh]\nfile = \"none.msh\"")
    } else {
        format!("[mesh]\nfile = \"none.msh\"\n{job}")
    }
}

/// The largest difference of the temperature from a function of the place, over all ranks.
fn error<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    expected: impl Fn(&[f64; D]) -> f64,
) -> f64 {
    let temperature = run.body.heat.as_ref().expect("heat").temperature();
    let places = run.body.mesh.nodes.iter();
    let mine =
        temperature.iter().zip(places).map(|(t, place)| (t - expected(place)).abs()).fold(0.0, f64::max);
    session.largest([mine])[0]
}

/// Runs to the end, with the balance of heat closed.
fn finish<const D: usize, const S: usize>(session: &Session, run: &mut Simulation<D, S>) {
    while run.advance(session).expect("a step").is_some() {}
    let totals = &run.totals;
    assert!(totals.max_heat_imbalance < 1e-10, "{}", totals.max_heat_imbalance);
}

/// Heat that enters on the right and leaves on the left, where the temperature is given.
fn slab<const D: usize, const S: usize>(session: &Session, order: usize, mesh: &GlobalMesh<D>) {
    let length = mesh.nodes.iter().map(|node| node[0]).fold(0.0, f64::max);
    let tables = "[[heat]]\non = [\"left\"]\ntemperature = 300\n[[heat]]\non = [\"right\"]\nflux = 5\n\
                  [initial]\ntemperature = 290\n";
    let job = still::<D>("plane_strain", [1e9, 1e9], tables).replacen(
        "[material]",
        &format!("[mesh]\norder = {order}\n[material]"),
        1,
    );
    let mut run = simulation::<D, S>(session, &job, mesh);
    finish(session, &mut run);
    let off = error(session, &run, |place| 300.0 + 2.5 * place[0]);
    assert!(off < 1e-6, "{off}");
    let tables = "[[heat]]\non = [\"left\"]\ntemperature = 300\n\
                  [[heat]]\non = [\"right\"]\nconvection = { coefficient = 4, ambient = 200 }\n[initial]\ntemperature = 290\n";
    let job = still::<D>("plane_strain", [1e9, 1e9], tables).replacen(
        "[material]",
        &format!("[mesh]\norder = {order}\n[material]"),
        1,
    );
    let mut run = simulation::<D, S>(session, &job, mesh);
    finish(session, &mut run);
    // 2 s = 4 (T - 200) with T = 300 - s L.
    let slope = 400.0 / (2.0 + 4.0 * length);
    let off = error(session, &run, |place| 300.0 - slope * place[0]);
    assert!(off < 1e-6, "{off}");
}

/// A mode of an insulated slab decays as `exp(-k (pi / L)^2 t / c)`, and keeps the heat.
fn mode<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, length: f64) {
    let tables = format!("[initial]\ntemperature = \"7 + cos(pi*x/{length})\"\n");
    let job = still::<D>("plane_strain", [0.5, 0.005], &tables);
    let mut run = simulation::<D, S>(session, &job, mesh);
    while let Some(outcome) = run.advance(session).expect("a step") {
        let amplitude = (-run.state.time * 2.0 / 3.0 * (PI / length).powi(2)).exp();
        let off = error(session, &run, |place| 7.0 + amplitude * (PI * place[0] / length).cos());
        assert!(off < 0.02, "{off} at {}", run.state.time);
        assert_eq!(outcome.energy[ENTERED_HEAT], 0.0);
    }
    assert!(run.totals.energy[STORED_HEAT].abs() < 0.02, "{}", run.totals.energy[STORED_HEAT]);
}

/// The node in the middle of a square of four triangles has a third of its capacity, and each triangle conducts `k` to it: its temperature
/// beyond that of the sides falls by `1 / (1 + 12 k dt / c)` in each step.
fn one_node(session: &Session) {
    let mesh = rectangle([1.0, 1.0], [1, 1], Diagonal::Crossed, [1.0; 2]).expect("mesh");
    let tables = "[[heat]]\non = [\"left\", \"right\"]\ntemperature = 5\n\
                  [initial]\ntemperature = \"5 + 16*x*(1 - x)*y*(1 - y)\"\n";
    let mut run = simulation::<2, 4>(session, &still::<2>("plane_strain", [0.5, 0.05], tables), &mesh);
    let mut rise = 1.0;
    while run.advance(session).expect("a step").is_some() {
        rise /= 1.0 + 12.0 * 2.0 * 0.05 / 3.0;
        let off =
            error(
                session,
                &run,
                |[x, y]| if (x - 0.5).abs() + (y - 0.5).abs() < 0.1 { 5.0 + rise } else { 5.0 },
            );
        assert!(off < 1e-13, "{off} at {}", run.state.time);
    }
}

/// A body of two materials in contact with heat: the flux is the same in both.
fn two_materials(session: &Session) {
    let mut mesh = rectangle([2.0, 1.0], [8, 4], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    mesh.regions = vec!["body".into(), "core".into()];
    let centre = |cell: usize| {
        mesh.cells[3 * cell..3 * cell + 3].iter().map(|n| mesh.nodes[*n as usize][0]).sum::<f64>() / 3.0
    };
    mesh.cell_regions = (0..mesh.cells.len() / 3).map(|cell| u16::from(centre(cell) > 1.0)).collect();
    let tables = "[[heat]]\non = [\"left\"]\ntemperature = 300\n[[heat]]\non = [\"right\"]\nflux = 5\n\
                  [initial]\ntemperature = 290\n[[region]]\nname = \"core\"\n[region.material]\n\
                  elasticity = { youngs_modulus = 50, poisson_ratio = 0.3 }\nheat = { conductivity = 10, volumetric_capacity = 1 }\n";
    let job = unknown_mesh(&still::<2>("plane_strain", [1e9, 1e9], tables));
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    finish(session, &mut run);
    let off = error(session, &run, |[x, _]| 300.0 + 2.5 * x.min(1.0) + 0.5 * (x - 1.0).max(0.0));
    assert!(off < 1e-6, "{off}");
}

/// A block whose top is held along x, pressed on a belt, with these materials and steps: of `height`, as wide as 1 m.
fn dragged(scheme: &str, [end, step]: [f64; 2], material: &str) -> String {
    format!(
        "{}[material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }}\n{material}\n\
         [[support]]\non = [\"top\"]\nfix = [\"x\"]\n[[traction]]\non = [\"top\"]\npressure = 1000\n\
         [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.coulomb = {{ coefficient = 0.4 }}\n\
         obstacle.plane = {{ point = [\"2*t\", 0], normal = [0, 1] }}\n\
         [initial]\ntemperature = 300\n[time]\nend = {end}\nstep = {step}\nscheme = \"{scheme}\"\n",
        any_mesh::<2>()
    )
}

/// All heat of friction stays in an insulated block: `T = T0 + mu p v t / (c h)`.
fn sliding_block(session: &Session, scheme: &str, order: usize) {
    let height = 0.5;
    let mesh = rectangle([1.0, height], [6, 3], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let material = "heat = { conductivity = 1e6, volumetric_capacity = 300 }";
    let job = dragged(scheme, [2.0, 0.1], material).replacen(
        "[material]",
        &format!("[mesh]\norder = {order}\n[material]"),
        1,
    );
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    finish(session, &mut run);
    let energy = &run.totals.energy;
    let [heat, lost] = [energy[FRICTION_HEAT], energy[CONTACT]];
    assert!((heat - lost).abs() < 1e-10 * lost, "{scheme} {order}: {heat} {lost}");
    assert!((energy[STORED_HEAT] - lost).abs() < 1e-10 * lost, "{scheme} {order}");
    let expected = 300.0 + 0.4 * 1000.0 * 2.0 * 2.0 / (300.0 * height);
    // Elastic shear takes up a part of the first way.
    let off = error(session, &run, |_| expected);
    assert!(off < 1e-4 * (expected - 300.0), "{scheme} {order}: {off}");
    assert!(run.totals.max_energy_imbalance < 1e-9, "{scheme}: {}", run.totals.max_energy_imbalance);
}

/// The surface of a half-space on which friction releases the power q: `T = T0 + 2 q sqrt(t / (pi k c))`.
fn flash_temperature(session: &Session) {
    let mut mesh = rectangle([0.1, 1.0], [1, 60], Diagonal::Crossed, [1.0, 2.0]).expect("mesh");
    mesh.nodes.iter_mut().for_each(|node| node[0] *= 100.0);
    let job =
        dragged("implicit_euler", [0.5, 0.0025], "heat = { conductivity = 2, volumetric_capacity = 300 }");
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    finish(session, &mut run);
    let rise = 2.0 * 0.4 * 1000.0 * 2.0 * (0.5 / (PI * 2.0 * 300.0)).sqrt();
    // Friction presses one side of the block more than the other: the mean counts.
    let (heat, mesh) = (run.body.heat.as_ref().expect("heat"), &run.body.mesh);
    let owned = mesh.nodes[..mesh.owned].iter().zip(heat.temperature());
    let surface = owned.filter(|(place, _)| place[1] == 0.0).map(|(_, temperature)| temperature - 300.0);
    let [sum, count] = session.sum(surface.fold([0.0; 2], |[sum, count], rise| [sum + rise, count + 1.0]));
    assert!((sum / count / rise - 1.0).abs() < 0.01, "{} {rise}", sum / count);
}

/// Viscosity and flow heat the body by their share of what they dissipate, in every step.
fn flowing(session: &Session, scheme: &str, [order, share]: [f64; 2], hypothesis: &str) {
    let mesh = crossed([4, 3]);
    let job = format!(
        "{}[mesh]\norder = {order}\n[material]\nhypothesis = \"{hypothesis}\"\ndensity = 1\n\
         elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\nviscosity = {{ volumetric = 2, shear = 5 }}\n\
         viscoplasticity.perzyna = {{ relaxation = 20, yield_stress = 3 }}\n\
         heat = {{ conductivity = 2, capacity = 3, dissipation_share = {share} }}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"right\"]\nvalue = [\"40*min(t/0.1, 1)\", 7]\n\
         [initial]\ntemperature = 300\n[time]\nend = 0.3\nstep = 0.01\nscheme = \"{scheme}\"\n",
        any_mesh::<2>()
    );
    let check = |energy: &clarke::fem::effect::Energy| {
        let lost = share * (energy[VISCOUS] + energy[VISCOPLASTIC]);
        assert!(energy[VISCOPLASTIC] > 1e-3 && energy[VISCOUS] > 1e-3, "{energy:?}");
        let heat = energy[FLOW_HEAT];
        assert!((heat - lost).abs() < 1e-10 * lost, "{scheme} {order} {hypothesis}: {heat} {lost}");
        assert!((energy[STORED_HEAT] - heat).abs() < 1e-10 * heat, "{scheme} {order} {hypothesis}");
    };
    if hypothesis == "plane_stress" {
        let mut run = simulation::<2, 3>(session, &job, &mesh);
        finish(session, &mut run);
        check(&run.totals.energy);
    } else {
        let mut run = simulation::<2, 4>(session, &job, &mesh);
        finish(session, &mut run);
        check(&run.totals.energy);
    }
}

/// A body that heat from the right warms evenly, with these supports, elasticity and kind of stress: its density is absent or of this text.
fn warmed<const D: usize>(hypothesis: &str, order: usize, elasticity: &str, supports: &str) -> String {
    let hypothesis = if D == 2 { format!("hypothesis = \"{hypothesis}\"\n") } else { String::new() };
    format!(
        "{}[mesh]\norder = {order}\n[material]\n{hypothesis}{elasticity}\n\
         heat = {{ conductivity = 1e7, volumetric_capacity = 3, expansion = 2e-5, reference = 280 }}\n{supports}\
         [[heat]]\non = [\"right\"]\nflux = 30\n[initial]\ntemperature = 290\n\
         [time]\nend = 1\nstep = 0.125\nland_on = [0.376]\nscheme = \"implicit_euler\"\n",
        any_mesh::<D>()
    )
}

const ISOTROPIC: &str = "elasticity = { youngs_modulus = 5000, poisson_ratio = 0.3 }";

/// Steps to the end, and checks each state with the temperature and how fast it has risen in the step.
fn follow<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: &GlobalMesh<D>,
    check: impl Fn([f64; 2], &Simulation<D, S>),
) {
    let mut run = simulation::<D, S>(session, job, mesh);
    let temperature = |run: &Simulation<D, S>| {
        session.largest([run
            .body
            .heat
            .as_ref()
            .expect("heat")
            .temperature()
            .iter()
            .fold(0.0, |m: f64, t| m.max(*t))])[0]
    };
    let mut before = temperature(&run);
    while run.advance(session).expect("a step").is_some() {
        let now = temperature(&run);
        check([now, (now - before) / run.state.step_length], &run);
        before = now;
    }
    assert!(
        before > 295.0 && run.totals.max_energy_imbalance < 1e-9,
        "{before} {}",
        run.totals.max_energy_imbalance
    );
}

/// Stress components of all cells lie within a share of `scale` of these.
fn stress_is<const D: usize, const S: usize>(run: &Simulation<D, S>, expected: [f64; S], scale: f64) {
    for stress in run.body.stress(&run.state).expect("stress") {
        for c in 0..S {
            assert!((stress[c] - expected[c]).abs() < 2e-6 * scale, "{stress:?} {expected:?}");
        }
    }
}

/// A free body expands as fast as it warms, also in steps of other lengths than the one before, and has no stress.
fn free<const D: usize, const S: usize>(session: &Session, hypothesis: &str, mesh: &GlobalMesh<D>) {
    let mut supports = String::from(
        "[[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"",
    );
    supports += if D == 2 { "y\"]\n" } else { "z\"]\n[[support]]\non = [\"front\"]\nfix = [\"y\"]\n" };
    for order in [1, 2] {
        follow::<D, S>(
            session,
            &warmed::<D>(hypothesis, order, ISOTROPIC, &supports),
            mesh,
            |[temperature, rate], run| {
                let strain = 2e-5 * (temperature - 280.0);
                stress_is(run, [0.0; S], 5000.0 * strain);
                let fields = [(&run.state.displacement, strain), (&run.state.velocity, 2e-5 * rate)];
                // The first step expands from the reference.
                let count = if run.state.step == 1 { 1 } else { 2 };
                for (field, expected) in fields.into_iter().take(count) {
                    let values = field.local().expect("values");
                    for (u, place) in values.chunks_exact(D).zip(&run.body.mesh.nodes) {
                        (0..D).for_each(|i| {
                            assert!((u[i] - expected * place[i]).abs() < 3e-6 * expected, "{u:?} {place:?}")
                        });
                    }
                }
            },
        );
    }
}

/// A body that is held everywhere has the stress of its thermal strain.
fn held_body<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    mesh: &GlobalMesh<D>,
    modulus: f64,
) {
    let mut names = vec!["left", "right", "bottom", "top"];
    if D == 3 {
        names.extend(["front", "back"]);
    }
    let supports = format!("[[support]]\non = {names:?}\nfix = \"normal\"\n");
    for order in [1, 2] {
        follow::<D, S>(
            session,
            &warmed::<D>(hypothesis, order, ISOTROPIC, &supports),
            mesh,
            |[temperature, _], run| {
                let pressure = modulus * 2e-5 * (temperature - 280.0);
                for stress in run.body.stress(&run.state).expect("stress") {
                    let mean = clarke::linear_algebra::tensor::trace(&stress);
                    let normals = if S == 3 { 2.0 } else { 3.0 };
                    assert!((mean + normals * pressure).abs() < 2e-6 * pressure, "{stress:?} {pressure}");
                    assert!(
                        clarke::linear_algebra::tensor::von_mises(&stress)
                            < if S == 3 { f64::INFINITY } else { 2e-6 * pressure }
                    );
                }
            },
        );
    }
}

/// A strip of two materials of the same stiffness bends by `3/2 (difference of the strains) / thickness`.
fn bimetal(session: &Session) {
    let mut mesh = rectangle([2.0, 0.1], [40, 4], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    mesh.regions = vec!["body".into(), "core".into()];
    let centre = |cell: usize| {
        mesh.cells[3 * cell..3 * cell + 3].iter().map(|n| mesh.nodes[*n as usize][1]).sum::<f64>() / 3.0
    };
    mesh.cell_regions = (0..mesh.cells.len() / 3).map(|cell| u16::from(centre(cell) > 0.05)).collect();
    let supports = "[[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"left\"]\nwhere = \"y < 1e-9\"\nfix = [\"y\"]\n\
                    [[region]]\nname = \"core\"\n[region.material]\nelasticity = { youngs_modulus = 5000, poisson_ratio = 0.3 }\n\
                    heat = { conductivity = 1e7, volumetric_capacity = 3, expansion = 1e-5, reference = 280 }\n";
    let job = unknown_mesh(&warmed::<2>("plane_stress", 2, ISOTROPIC, supports));
    follow::<2, 3>(session, &job, &mesh, |[temperature, _], run| {
        let curvature = 1.5 * 1e-5 * (temperature - 280.0) / 0.1;
        let displacement = run.state.displacement.local().expect("values");
        for (u, place) in displacement.chunks_exact(2).zip(&run.body.mesh.nodes).filter(|(_, x)| x[0] == 2.0)
        {
            let expected = curvature * 2.0;
            assert!((u[1] / expected - 1.0).abs() < 0.02, "{u:?} at {place:?}: {expected}");
        }
    });
}

/// The balance closes under every scheme where a temperature strains a body that moves, flows and is damaged.
fn balance(session: &Session, scheme: &str, law: &str) {
    let job = format!(
        "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 1\nviscosity = {{ volumetric = 2, shear = 5 }}\n{law}\n\
         heat = {{ conductivity = 20, capacity = 3, expansion = 1e-3, reference = 300 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[heat]]\non = [\"top\"]\nflux = \"900*sin(20*t)\"\n\
         [initial]\ntemperature = \"300 + 4*x\"\n[time]\nend = 0.3\nstep = 0.01\nscheme = \"{scheme}\"\n",
        any_mesh::<2>()
    );
    let mut run = simulation::<2, 4>(session, &job, &crossed([4, 3]));
    finish(session, &mut run);
    let totals = &run.totals;
    assert!(totals.energy[THERMAL_WORK].abs() > 1e-3, "{scheme} {law}");
    assert!(totals.max_energy_imbalance < 1e-10, "{scheme} {law}: {}", totals.max_energy_imbalance);
}

#[test]
fn bodies_expand_and_bear_the_stress_of_what_is_held() {
    run_on(&[1, 3], |world| {
        let session = &world.session;
        free::<2, 3>(session, "plane_stress", &crossed([4, 3]));
        free::<3, 6>(session, "", &brick([3, 2, 2]));
        held_body::<2, 3>(session, "plane_stress", &crossed([4, 3]), 5000.0 / 0.7);
        held_body::<2, 4>(session, "plane_strain", &crossed([4, 3]), 5000.0 / 0.4);
        held_body::<3, 6>(session, "", &brick([3, 2, 2]), 5000.0 / 0.4);
        bimetal(session);
    });
}

/// Expansion does no work on a body without stress, and on one that is held what it stores, at the temperature at the end of each step.
fn work_of_expansion(session: &Session, scheme: &str) {
    let held = "[[support]]\non = [\"left\", \"right\", \"bottom\", \"top\"]\nfix = \"normal\"\n";
    let free = "[[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n";
    // Inertia would let a free body vibrate.
    let density = if scheme == "midpoint" { "density = 1e-12\n" } else { "" };
    for (supports, share) in [(held, 1.0), (free, 0.0)] {
        if scheme == "midpoint" && share == 0.0 {
            continue;
        }
        let job = warmed::<2>("plane_stress", 1, &format!("{density}{ISOTROPIC}"), supports)
            .replace("temperature = 290", "temperature = 280")
            .replace("land_on = [0.376]\n", if scheme == "midpoint" { "" } else { "land_on = [0.376]\n" })
            .replace("implicit_euler", scheme);
        let mesh = crossed([4, 3]);
        let mut run = simulation::<2, 3>(session, &job, &mesh);
        while run.advance(session).expect("a step").is_some() {
            let (heat, energy) = (run.body.heat.as_ref().expect("heat"), &run.totals.energy);
            let strain = 2e-5 * (heat.temperature()[0] - 280.0);
            let [width, height] = [0, 1].map(|i| mesh.nodes.iter().map(|node| node[i]).fold(0.0, f64::max));
            // Stress along two axes.
            let stored = 5000.0 / 0.7 * strain * strain * width * height;
            for (kind, share) in [(THERMAL_WORK, share), (ELASTIC, share), (NUMERICAL, 0.0)] {
                let off = (energy[kind] - share * stored).abs();
                assert!(off < 1e-5 * stored, "{scheme} {share}: {} {} {stored}", kind.column, energy[kind]);
            }
        }
    }
}

#[test]
fn energy_balances_where_a_temperature_strains_the_body() {
    run_on(&[1, 2], |world| {
        let elastic = "elasticity = { youngs_modulus = 1000, poisson_ratio = 0.3 }";
        let flow = "viscoplasticity.perzyna = { relaxation = 20, yield_stress = 1 }";
        let damage = "damage = { threshold = 1e-4, viscosity = 1, largest = 0.5 }";
        for scheme in ["implicit_euler", "bdf2", "midpoint"] {
            work_of_expansion(&world.session, scheme);
        }
        for scheme in ["lagged_euler", "implicit_euler", "bdf2", "midpoint"] {
            balance(&world.session, scheme, elastic);
            balance(&world.session, scheme, &format!("{elastic}\n{flow}"));
            if scheme != "midpoint" {
                balance(&world.session, scheme, &format!("{elastic}\n{damage}"));
            }
        }
    });
}

/// A brake whose coefficient of friction fades as it warms: that of each step is the one of the temperature at its end if it released as
/// much heat as the step before.
fn fading_brake(session: &Session, scheme: &str) {
    let mesh = rectangle([1.0, 0.5], [4, 2], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let job = dragged(scheme, [4.0, 0.05], "heat = { conductivity = 1e9, volumetric_capacity = 300 }")
        .replace(
            "friction.coulomb = { coefficient = 0.4 }",
            "friction.expression.coefficient = \"0.4/(1 + max(temperature - 300, 0)/20)\"",
        );
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    let (mut rise, mut power, mut mean) = (0.0, 0.0, 0.0);
    while run.advance(session).expect("a step").is_some() {
        let next = 800.0 / (1.0 + (rise + 0.05 * mean / 150.0) / 20.0);
        // Powers are means over steps of second order, the first two of which are of first order.
        mean = if scheme == "bdf2" && run.state.step > 2 { 0.5 * (power + next) } else { next };
        (rise, power) = (rise + 0.05 * mean / 150.0, next);
        let off = error(session, &run, |_| 300.0 + rise);
        assert!(off < 1e-4 * rise, "{scheme}: {off} at {}", run.state.time);
    }
    let exact = 20.0 * ((1.0 + 2.0 * 800.0 * 4.0 / (150.0 * 20.0_f64)).sqrt() - 1.0);
    assert!((rise / exact - 1.0).abs() < 0.01, "{rise} {exact}");
}

/// A bar under a constant load creeps at the rate of the temperature at the end of each step.
fn creeping_bar(session: &Session, scheme: &str, order: usize) {
    let law = format!(
        "{ISOTROPIC}\nviscoplasticity.expression = {{ rate = \"1e-3*(q/10)*max(temperature - 280, 0)/50\", reference_stress = 20 }}"
    );
    let supports = "[[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
                    [[traction]]\non = [\"right\"]\nvalue = [10, 0]\n";
    let job = warmed::<2>("plane_stress", order, &law, supports)
        .replace("expansion = 2e-5, reference = 280", "dissipation_share = 0")
        .replace("implicit_euler", scheme);
    let mesh = crossed([4, 3]);
    let mut creep = 0.0;
    let mut run = simulation::<2, 3>(session, &job, &mesh);
    let warmth = |run: &Simulation<2, 3>| run.body.heat.as_ref().expect("heat").temperature()[0];
    while run.advance(session).expect("a step").is_some() {
        creep += run.state.step_length * 1e-3 * (warmth(&run) - 280.0) / 50.0;
        let displacement = run.state.displacement.local().expect("values");
        let expected = 10.0 / 5000.0 + creep;
        for (u, place) in displacement.chunks_exact(2).zip(&run.body.mesh.nodes) {
            assert!(
                (u[0] - expected * place[0]).abs() < 1e-8 * expected,
                "{scheme}: {u:?} {place:?} {expected}"
            );
        }
    }
    assert!(creep > 2e-4 && warmth(&run) > 295.0, "{creep}");
}

#[test]
fn creep_is_as_fast_as_the_temperature_at_the_end_of_a_step_has_it() {
    run_on(&[1, 2], |world| {
        for order in [1, 2] {
            creeping_bar(&world.session, "implicit_euler", order);
        }
    });
}

/// A bar under a constant stress s that creeps at the rate r e^(b (T - 300)) warms by its own flow: c T' = s r e^(b (T - 300)), so that
/// T = 300 - ln(1 - t/t') / b, which has no bound as t comes to t' = c/(b s r) = 125 s.
fn runaway(session: &Session, steps: f64) -> f64 {
    let end = 0.9 * 125.0;
    let job = format!(
        "{}[material]\nhypothesis = \"plane_stress\"\nelasticity = {{ youngs_modulus = 1e11, poisson_ratio = 0.3 }}\n\
         heat = {{ conductivity = 1, volumetric_capacity = 1e5 }}\n\
         viscoplasticity.expression = {{ rate = \"1e-3*(q/1e6)^3*exp(0.05*(temperature - 300))\", reference_stress = 1e7 }}\n\
         [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
         [[traction]]\non = [\"right\"]\nvalue = [2e6, 0]\n[initial]\ntemperature = 300\n\
         [time]\nend = {end}\nstep = {}\nscheme = \"bdf2\"\n",
        any_mesh::<2>(),
        end / steps
    );
    let mut run = simulation::<2, 3>(session, &job, &crossed([2, 2]));
    finish(session, &mut run);
    error(session, &run, |_| 300.0 + 20.0 * 10.0_f64.ln())
}

#[test]
fn flow_that_warms_its_body_runs_away_as_in_closed_form() {
    run_on(&[1, 2], |world| {
        let [coarse, fine] = [100.0, 200.0].map(|steps| runaway(&world.session, steps));
        assert!(fine < 0.02 && coarse / fine > 3.5, "{coarse} {fine}");
    });
}

#[test]
fn a_brake_fades_as_it_warms() {
    run_on(&[1, 2], |world| {
        for scheme in ["implicit_euler", "bdf2"] {
            fading_brake(&world.session, scheme);
        }
    });
}

#[test]
fn friction_heats_a_sliding_block() {
    run_on(&[1, 2, 3], |world| {
        for (scheme, order) in [("implicit_euler", 1), ("implicit_euler", 2), ("bdf2", 1), ("bdf2", 2)] {
            sliding_block(&world.session, scheme, order);
        }
        flash_temperature(&world.session);
    });
}

#[test]
fn what_viscosity_and_flow_dissipate_becomes_heat() {
    run_on(&[1, 3], |world| {
        for scheme in ["lagged_euler", "implicit_euler", "bdf2", "midpoint"] {
            for (order, hypothesis) in [(1.0, "plane_strain"), (2.0, "axisymmetric"), (1.0, "plane_stress")] {
                flowing(&world.session, scheme, [order, 0.9], hypothesis);
            }
        }
    });
}

#[test]
fn temperatures_follow_their_closed_forms() {
    run_on(&[1, 2, 3], |world| {
        let session = &world.session;
        for order in [1, 2] {
            slab::<2, 4>(session, order, &crossed([4, 3]));
            slab::<3, 6>(session, order, &brick([3, 2, 2]));
        }
        let square = rectangle([1.5, 0.5], [24, 8], Diagonal::Crossed, [1.0; 2]).expect("mesh");
        mode::<2, 4>(session, &square, 1.5);
        mode::<3, 6>(session, &box_mesh([1.5, 0.5, 0.5], [12, 4, 4], [1.0; 3]).expect("mesh"), 1.5);
        one_node(session);
        two_materials(session);
    });
}
