// A brick of 2 x 1 x 1. Saved as ASCII and as binary, with Mesh.SaveAll = 1: the volume has no group.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 2, 1, 1};
MeshSize{ PointsOf{ Volume{1}; } } = 0.6;
Physical Surface("low", 1) = {1};
Physical Surface("rest", 2) = {2, 3, 4, 5, 6};
