#pragma once

#include <filesystem>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// An AVI of Motion-JPEGs, 25 a second.
void WriteVideo(const std::filesystem::path& path, const std::vector<Image>& frames);

}  // namespace pepeseg::testing
