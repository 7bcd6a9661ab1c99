"""Names of array types, by element and number of axes; kernels are compiled for the types that their annotations name.

Where no kernel reads them, arrays of any number of axes go by the names of one axis.
"""

from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

Float64s = npt.NDArray[np.float64]
Float32s = npt.NDArray[np.float32]
Int64s = npt.NDArray[np.int64]
Int32s = npt.NDArray[np.int32]
UInt64s = npt.NDArray[np.uint64]
UInt32s = npt.NDArray[np.uint32]
UInt16s = npt.NDArray[np.uint16]
UInt8s = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]

Float64Rows = Annotated[Float64s, 2]
Float32Rows = Annotated[Float32s, 2]
Int64Rows = Annotated[Int64s, 2]
Int32Rows = Annotated[Int32s, 2]
UInt32Rows = Annotated[UInt32s, 2]
BoolRows = Annotated[Bools, 2]

Float64Grid = Annotated[Float64s, 3]
Float32Grid = Annotated[Float32s, 3]

AnyFloats = npt.NDArray[np.floating[Any]]
AnyInts = npt.NDArray[np.integer[Any]]
