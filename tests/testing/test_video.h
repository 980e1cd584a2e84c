#pragma once

#include <filesystem>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// Writes an AVI with Motion JPEG, 25 frames a second.
void WriteVideo(const std::filesystem::path& path, const std::vector<Image>& frames);

}  // namespace pepeseg::testing
