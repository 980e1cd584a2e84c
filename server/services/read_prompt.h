#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "pepeseg/v1/prompt.pb.h"
#include "server/rpc/service_context.h"
#include "server/services/model_lookup.h"

// Parts of a request that say what is asked about, in the model's terms. INVALID_ARGUMENT names the
// field, below `field`.
namespace pepeseg {

// One of the model's views, by its name.
absl::StatusOr<ModelView> FindView(const std::string& name, const Model& model,
                                   const std::string& field);
// The view that a viewpoint names, or its free camera.
absl::StatusOr<ModelView> FindViewpoint(const v1::Viewpoint& viewpoint, const Model& model,
                                        const std::string& field);

// A prompt in the pixels of `frame`, as one in those of its view. A label stands for its mask.
// INVALID_ARGUMENT, too: a point or box outside of the image or of what the view shows of it.
// NOT_FOUND: no such label; FAILED_PRECONDITION: its view is none of
// the model's. Blocks on the store.
absl::StatusOr<Prompt> ReadPrompt(const ServiceContext& context, const ResidentModel& model,
                                  const v1::Prompt& prompt, v1::PixelFrame frame);
absl::StatusOr<Granularity> ReadGranularity(const v1::Granularity& granularity, const Model& model,
                                            const std::string& field);

}  // namespace pepeseg
