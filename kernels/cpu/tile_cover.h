#pragma once

#include "kernels/math/tile_cover.h"
