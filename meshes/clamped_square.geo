// The unit square, graded toward the two ends of its left side, where a body that is held there has singular stress.
//   gmsh -2 -format msh41 -o clamped_square.msh clamped_square.geo
//
// At a distance d from the nearer corner cells are h sqrt(d) long, at the corner itself h^2: as of [mesh.rectangle] with
// a grading of 2, but alike in all directions.

h = 0.08;

Point(1) = {0, 0, 0};
Point(2) = {1, 0, 0};
Point(3) = {1, 1, 0};
Point(4) = {0, 1, 0};

Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};

Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Field[1] = Distance;
Field[1].PointsList = {1, 4};
Field[2] = MathEval;
Field[2].F = Sprintf("%g * Sqrt(F1 + %g)", h, h * h);
Background Field = 2;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

Physical Curve("bottom", 1) = {1};
Physical Curve("right", 2) = {2};
Physical Curve("top", 3) = {3};
Physical Curve("left", 4) = {4};
Physical Surface("body", 5) = {1};
