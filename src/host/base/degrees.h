/* Degrees, the unit of angles in what people read and write. */
#ifndef CAIRN_HOST_BASE_DEGREES_H
#define CAIRN_HOST_BASE_DEGREES_H

/* rad */
#define CAIRN_DEGREE 0.017453292519943295

#define CAIRN_DEGREES_PER_RADIAN 57.29577951308232

#endif
