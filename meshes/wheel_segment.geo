// The lower half of a wheel with a hub bore and a tread of another material; it touches the plane z = 0 along the
// line x = 0. Radius 1 m, bore 0.3 m, tread 0.2 m thick, width 0.4 m along y, axis at z = 1.
//   gmsh -3 -format msh41 -bin -o wheel_segment.msh wheel_segment.geo

SetFactory("OpenCASCADE");

radius = 1.0;
tread = 0.2;
bore = 0.3;
width = 0.4;

Cylinder(1) = {0, 0, radius, 0, width, 0, radius, Pi};
Cylinder(2) = {0, 0, radius, 0, width, 0, radius - tread, Pi};
Cylinder(3) = {0, 0, radius, 0, width, 0, bore, Pi};
Rotate {{0, 1, 0}, {0, 0, radius}, Pi/2} { Volume{1, 2, 3}; }
BooleanDifference{ Volume{1}; Delete; }{ Volume{2}; }
BooleanDifference{ Volume{2}; Delete; }{ Volume{3}; Delete; }
Coherence;

Physical Surface("foundation", 1) = {31};
Physical Surface("clamp", 2) = {26};
Physical Surface("load", 3) = {33, 35, 37, 39};
Physical Volume("tread", 4) = {1};
Physical Volume("core", 5) = {2};

// Fine where the wheel touches, coarse elsewhere.
Field[1] = Box;
Field[1].VIn = 0.06;
Field[1].VOut = 0.13;
Field[1].XMin = -0.35;
Field[1].XMax = 0.35;
Field[1].YMin = 0;
Field[1].YMax = width;
Field[1].ZMin = 0;
Field[1].ZMax = 0.15;
Field[1].Thickness = 0.4;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
