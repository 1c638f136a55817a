// A block of 2 m x 1 m with fine cells around the middle of its lower side.
Point(1) = {-1, 0, 0};
Point(2) = {1, 0, 0};
Point(3) = {1, 1, 0};
Point(4) = {-1, 1, 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Curve("bottom") = {1};
Physical Curve("right") = {2};
Physical Curve("top") = {3};
Physical Curve("left") = {4};
Physical Surface("block") = {1};
// The size of the cells in the middle: gmsh -2 -format msh41 -setnumber fine 0.004 -o half_plane_coarse.msh half_plane.geo
DefineConstant[ fine = 0.002 ];
Field[1] = MathEval;
Field[1].F = Sprintf("%g + 0.1*(sqrt(x*x + y*y) - 0.045 + abs(sqrt(x*x + y*y) - 0.045))", fine);
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
