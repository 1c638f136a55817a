//! Rung 3: the Jacobian of a contact step is the derivative of its residual.

use crate::run_on;
use crate::scenes::{body, brick, crossed, noise, set_nodal};
use clarke::{
    contact::{DampedResponse, Graph, Symmetry},
    effect::{Contact, Effect, Held, Inertia, Quadrature, ViscousStress},
    material::{ByMaterial, Isotropic},
    mesh::GlobalMesh,
    petsc::{Matrix, NonlinearProblem},
    session::Session,
    stepping::ContactEquations,
};

fn laws() -> Vec<Graph> {
    let damped = |symmetry| {
        let law = DampedResponse { breakpoints: vec![0.2, 0.5], slopes: vec![40.0, -25.0, 60.0], symmetry };
        law.graph().expect("graph")
    };
    let polyline = vec![[-0.4, -3.0], [0.0, -3.0], [0.3, 9.0]];
    vec![
        damped(Symmetry::Even),
        damped(Symmetry::Odd),
        damped(Symmetry::OneSided),
        Graph::new(polyline, 12.0, -8.0).expect("graph"),
    ]
}

fn differences<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>) {
    let effects: Vec<Box<dyn Effect<D, S>>> = vec![
        Box::new(Inertia { density: ByMaterial::uniform(2.0) }),
        Box::new(ViscousStress { tensor: ByMaterial::uniform(Isotropic { volumetric: 1.0, shear: 3.0 }) }),
    ];
    let (body, state) = body::<D, S>(session, whole, &[("left", Held::All)], effects);
    let matrix = Matrix::symmetric(D, &body.matrix(session, 0.1).expect("assembled")).expect("matrix");
    let vector = || state.velocity.like().expect("like");
    let mut facets = body.mesh.boundary("bottom").expect("bottom").facets.clone();
    facets.extend(&body.mesh.boundary("right").expect("right").facets);
    facets.sort_unstable();
    for (law, graph) in laws().into_iter().enumerate() {
        for quadrature in [Quadrature::Nodal, Quadrature::Gauss] {
            let contact = Contact::new(session, &body.mesh, &facets, quadrature, graph.clone(), &body.fixed)
                .expect("contact");
            assert!(session.total(contact.point_count()) > 0);
            let mut contacts = [contact];
            let mut scratch = [vector(), vector()];
            let ghosted = contacts[0].needs_ghosts().then_some(&mut scratch);
            let (mut load, mut point, mut direction, mut other) = (vector(), vector(), vector(), vector());
            let (mut above, mut below, mut derivative, mut second) = (vector(), vector(), vector(), vector());
            let random = |salt: usize| {
                move |id: usize, _: &[f64; D]| {
                    std::array::from_fn(|i| noise((((law * 8 + salt) * 1000 + id) * D + i) as u64))
                }
            };
            set_nodal(&body.mesh, &mut load, random(0));
            set_nodal(&body.mesh, &mut point, random(1));
            set_nodal(&body.mesh, &mut direction, random(2));
            set_nodal(&body.mesh, &mut other, random(3));
            for field in [&mut point, &mut direction, &mut other] {
                let mut values = field.owned_mut().expect("values");
                values.iter_mut().zip(&body.fixed).filter(|(_, f)| **f).for_each(|(v, _)| *v = 0.0);
            }
            let mut equations = ContactEquations {
                matrix: &matrix,
                contacts: &mut contacts,
                right_hand_side: &load,
                ghosted,
                residuals: 0,
            };
            equations.linearise(&point).expect("linearised");
            equations.apply_jacobian(&direction, &mut derivative).expect("derivative");
            equations.apply_jacobian(&other, &mut second).expect("derivative");
            let forth = other.dot(&derivative).expect("dot");
            let back = direction.dot(&second).expect("dot");
            assert!((forth - back).abs() < 1e-12 * (1.0 + forth.abs()), "the Jacobian is symmetric");

            let h = 1e-5;
            point.add_scaled(h, &direction).expect("add");
            equations.residual(&point, &mut above).expect("residual");
            point.add_scaled(-2.0 * h, &direction).expect("add");
            equations.residual(&point, &mut below).expect("residual");
            above.add_scaled(-1.0, &below).expect("add");
            let size = derivative.norm().expect("norm");
            derivative.add_scaled(-0.5 / h, &above).expect("add");
            let error = derivative.norm().expect("norm") / size;
            assert!(error < 1e-8, "{D}D, law {law}, {quadrature:?}: relative error {error}");
            assert_eq!(equations.residuals, 2);

            matrix.multiply(&direction, &mut second).expect("product");
            second.add_scaled(-0.5 / h, &above).expect("add");
            assert!(second.norm().expect("norm") > 1e-3 * size, "contact has its share in the difference");
        }
    }
}

pub fn compare(session: &Session) {
    differences::<2, 3>(session, &crossed([4, 3]));
    differences::<3, 6>(session, &brick([3, 2, 2]));
}

#[test]
fn the_jacobian_of_contact_is_the_difference_of_residuals() {
    run_on(&[1, 2, 3], "jacobian");
}
