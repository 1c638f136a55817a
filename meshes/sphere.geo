// A quarter of the lower half of a sphere of radius 50 mm around the origin, with small cells around its lowest point: a sector of 90
// degrees, turned about the z axis. The cap within 30 degrees of the lowest point has a name of its own. Edges are curved.
//   gmsh -3 -order 2 -format msh41 -bin -setnumber fine 0.004 -o sphere_coarse.msh sphere.geo
//   gmsh -3 -order 2 -format msh41 -bin -o sphere_medium.msh sphere.geo
//   gmsh -3 -order 2 -format msh41 -bin -setnumber fine 0.001 -o sphere_fine.msh sphere.geo
SetFactory("OpenCASCADE");
radius = 0.05;
Point(1) = {0, 0, 0};
Point(2) = {0, 0, -radius};
Point(3) = {radius*Sin(Pi/6), 0, -radius*Cos(Pi/6)};
Point(4) = {radius, 0, 0};
Line(1) = {1, 2};
Circle(2) = {2, 1, 3};
Circle(3) = {3, 1, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
turned[] = Extrude {{0, 0, 1}, {0, 0, 0}, Pi/2} { Surface{1}; };
Physical Surface("front") = {1};
Physical Surface("left") = {turned[0]};
Physical Surface("cap") = {turned[2]};
Physical Surface("equator") = {turned[4]};
Physical Volume("body") = {turned[1]};
// The size of the cells within 11 mm of the lowest point, from where it grows.
DefineConstant[ fine = 0.002 ];
Field[1] = MathEval;
Field[1].F = Sprintf("%g*(1 + 150*sqrt((0.05 + z)^2 + (0.5*(sqrt(x*x + y*y) - 0.011 + abs(sqrt(x*x + y*y) - 0.011)))^2))", fine);
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
