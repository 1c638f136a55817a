// A plate of 2 m x 1 m that rests on a foundation, with a round notch of radius 0.2 m in the middle of its top.
//   gmsh -2 -format msh41 -o notched_plate.msh notched_plate.geo

length = 2.0;
height = 1.0;
notch = 0.2;
coarse = 0.07;
fine = 0.025; // at the notch root
contact = 0.04; // at the foundation

Point(1) = {0, 0, 0, contact};
Point(2) = {length, 0, 0, contact};
Point(3) = {length, height, 0, coarse};
Point(4) = {length/2 + notch, height, 0, fine};
Point(5) = {length/2, height, 0};
Point(6) = {length/2, height - notch, 0, fine};
Point(7) = {length/2 - notch, height, 0, fine};
Point(8) = {0, height, 0, coarse};

Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Circle(4) = {4, 5, 6};
Circle(5) = {6, 5, 7};
Line(6) = {7, 8};
Line(7) = {8, 1};

Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7};
Plane Surface(1) = {1};

Physical Curve("foundation", 1) = {1};
Physical Curve("load", 2) = {2};
Physical Curve("clamp", 3) = {7};
Physical Curve("notch", 4) = {4, 5};
Physical Surface("plate", 5) = {1};
