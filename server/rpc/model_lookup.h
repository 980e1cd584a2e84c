#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

// The row of a model named in a request, where "live" is the newest. FAILED_PRECONDITION when there
// is none yet, with the scene's active job in the detail. Blocks.
absl::StatusOr<ModelRow> FindModel(const ServiceContext& context, const std::string& name,
                                   const std::string& field);

// The same, in memory; loads it when it is not. UNAVAILABLE with need, have and when to ask again
// while models in use leave no room; RESOURCE_EXHAUSTED when it can never fit. Blocks for as long
// as loading takes.
struct ResidentModel {
  std::string name;
  ModelCache::Handle segmenter;
};
absl::StatusOr<ResidentModel> LoadModel(const ServiceContext& context, const std::string& name,
                                        const std::string& field);
// For what is asked of its features. FAILED_PRECONDITION: it was trained without masks.
absl::StatusOr<ResidentModel> LoadModelWithFeatures(const ServiceContext& context,
                                                    const std::string& name,
                                                    const std::string& field);
absl::Status CheckFeatures(const ResidentModel& model);

// Key of a model in the cache.
std::string ResidentKey(const ModelRow& model);

}  // namespace pepeseg
