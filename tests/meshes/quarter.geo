// A quarter of a disc, 0.3 m thick, with a named curve and named points.
//
//     gmsh -3 -order 1 -format msh41 quarter.geo -o quarter_straight.msh
//     gmsh -3 -order 2 -format msh41 quarter.geo -o quarter_curved.msh
SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, 0, 0, 0, 0.3, 1, Pi/2};
MeshSize {:} = 0.4;
Physical Volume("body") = {1};
Physical Surface("mantle") = {1};
Physical Surface("top") = {2};
Physical Surface("bottom") = {3};
// The lower edge of the mantle, and the lower end of the axis under the same name.
Physical Curve("rim") = {3};
Physical Point("rim") = {6};
Physical Point("axis") = {5};
