from .gains import rga as rga
from .gains import rga_radius as rga_radius
from .gains import singular_values as singular_values
