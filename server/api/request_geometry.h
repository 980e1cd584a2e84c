#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/scene/model.h"
#include "pepeseg/v1/prompt.pb.h"
#include "server/api/request_image.h"

// Reads free cameras, points and boxes of requests. All return INVALID_ARGUMENT that names the
// field, at or below `field`.
namespace pepeseg {

// Reads a camera that is not one of the model's. Refuses values that are not finite or out of
// range.
absl::StatusOr<ModelView> FreeViewFromProto(const v1::Viewpoint::FreeCamera& proto,
                                            const std::string& field);

// Reads 1 to 64 finite points, of which at least one is positive, wherever they are.
absl::StatusOr<std::vector<PointPrompt>> PointsFromProto(const v1::PointsPrompt& proto,
                                                         const std::string& field = "points");

// Reads points or a box of an image as those of its view. A box may reach over the border of the
// image. Both refuse what is outside the image, or outside the part of it that the view shows
// (reason NOTHING_THERE).
absl::StatusOr<std::vector<PointPrompt>> ReadPoints(const v1::PointsPrompt& prompt,
                                                    const ImageOfView& image,
                                                    const std::string& field);
absl::StatusOr<BoxPrompt> ReadBox(const v1::BoxPrompt& prompt, const ImageOfView& image,
                                  const std::string& field);

}  // namespace pepeseg
