#pragma once

#include "clients/cli/picture.h"

namespace pepeseg::client::cli {

// One colour for an id wherever it is shown, neighbouring ids far apart; 0 is black.
Rgb ColorOfSegment(int id);
// An image of ids in these colours.
Picture ColorSegments(const Grey16Picture& ids);

}  // namespace pepeseg::client::cli
