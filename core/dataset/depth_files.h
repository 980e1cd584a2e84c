#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/dataset/mask_files.h"
#include "core/scene/capture.h"

namespace pepeseg {

// The depth map of a photograph, by the suffix of `name`:
//   .png  grey, 8 or 16 bit     .npy  see npy.h     .pfm  see pfm.h
// NaN where it says nothing: where a map of kind DEPTH is 0. 0 in a DISPARITY is far away. A map of
// another size than the photograph's stands for all of it, if its shape is the photograph's within
// 1 %. INVALID_ARGUMENT names the file: malformed, cut short, over 64 Mpx, another shape, or the
// first pixel that is not finite.
absl::StatusOr<FloatImage> ReadDepthMap(const std::filesystem::path& path, const std::string& name,
                                        DepthPrior::Kind kind, const PhotoSize& photo);

}  // namespace pepeseg
