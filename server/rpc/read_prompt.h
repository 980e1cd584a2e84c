#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "pepeseg/v1/prompt.pb.h"

// Parts of a request that say what is asked about, in the model's terms. INVALID_ARGUMENT names the
// field, below `field`.
namespace pepeseg {

// One of the model's views, by its name.
absl::StatusOr<ModelView> FindView(const std::string& name, const Model& model,
                                   const std::string& field);
// The view that a viewpoint names, or its free camera.
absl::StatusOr<ModelView> FindViewpoint(const v1::Viewpoint& viewpoint, const Model& model,
                                        const std::string& field);

absl::StatusOr<Prompt> ReadPrompt(const v1::Prompt& prompt, const Model& model,
                                  const std::string& field);
absl::StatusOr<Granularity> ReadGranularity(const v1::Granularity& granularity, const Model& model,
                                            const std::string& field);

}  // namespace pepeseg
