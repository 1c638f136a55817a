"""Reads the field files of a run with VTK (VTKHDF and XDMF) and meshio, and prints what each of them saw.

Usage: read_fields.py OUTPUT_FOLDER

The output is one JSON object: reader -> list of steps, each with its time, the number of points and cells, the sum of
the connectivity, and for each array its components, minimum, maximum and sum over each component.
"""

import json
import pathlib
import sys

import meshio
import numpy
import vtk
from vtk.util.numpy_support import vtk_to_numpy

VTK_TYPES = {"triangle": 5, "tetra": 10}


def describe(values):
    table = numpy.asarray(values, dtype=float)
    table = table.reshape(len(table), -1)
    return {
        "components": table.shape[1],
        "minimum": table.min(axis=0).tolist(),
        "maximum": table.max(axis=0).tolist(),
        "sum": table.sum(axis=0).tolist(),
    }


def vtk_arrays(attributes):
    arrays = (attributes.GetArray(number) for number in range(attributes.GetNumberOfArrays()))
    return {array.GetName(): describe(vtk_to_numpy(array)) for array in arrays}


def read_vtk(reader, path):
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    times = reader.GetOutputInformation(0).Get(key) or ()
    steps = []
    for time in times:
        reader.UpdateTimeStep(time)
        grid = reader.GetOutputDataObject(0)
        steps.append(
            {
                "time": time,
                "points": grid.GetNumberOfPoints(),
                "cells": grid.GetNumberOfCells(),
                "cell_types": sorted({grid.GetCellType(cell) for cell in range(grid.GetNumberOfCells())}),
                "connectivity": int(vtk_to_numpy(grid.GetCells().GetConnectivityArray()).sum()),
                "bounds": grid.GetBounds(),
                "point_data": vtk_arrays(grid.GetPointData()),
                "cell_data": vtk_arrays(grid.GetCellData()),
            }
        )
    return steps


def read_meshio(path):
    steps = []
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, blocks = reader.read_points_cells()
        low, high = points.min(axis=0), points.max(axis=0)
        for step in range(reader.num_steps):
            time, point_data, cell_data = reader.read_data(step)
            steps.append(
                {
                    "time": time,
                    "points": len(points),
                    "cells": sum(len(block.data) for block in blocks),
                    "cell_types": sorted({VTK_TYPES[block.type] for block in blocks}),
                    "connectivity": int(sum(block.data.sum() for block in blocks)),
                    "bounds": [bound for pair in zip(low.tolist(), high.tolist()) for bound in pair],
                    "point_data": {name: describe(values) for name, values in point_data.items()},
                    "cell_data": {name: describe(numpy.concatenate(values)) for name, values in cell_data.items()},
                }
            )
    return steps


def main():
    folder = pathlib.Path(sys.argv[1])
    seen = {
        "vtkhdf": read_vtk(vtk.vtkHDFReader(), folder / "fields.vtkhdf"),
        "xdmf": read_vtk(vtk.vtkXdmfReader(), folder / "fields.xdmf"),
        "meshio": read_meshio(folder / "fields.xdmf"),
    }
    json.dump(seen, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
