#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "pepeseg/v1/prompt.pb.h"
#include "server/api/request_image.h"

// Reads points and boxes of a request as those of a view. Both return INVALID_ARGUMENT that names
// the field, at or below `field`, for what is outside the image, or outside the part of it that the
// view shows (reason NOTHING_THERE).
namespace pepeseg {

// Reads 1 to 64 points, of which at least one is positive.
absl::StatusOr<std::vector<PointPrompt>> ReadPoints(const v1::PointsPrompt& prompt,
                                                    const ImageOfView& image,
                                                    const std::string& field);
// Reads a box, which may reach over the border of the image.
absl::StatusOr<BoxPrompt> ReadBox(const v1::BoxPrompt& prompt, const ImageOfView& image,
                                  const std::string& field);

}  // namespace pepeseg
