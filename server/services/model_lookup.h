#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/api/resource_name.h"
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
  std::string name;  // for clients
  ModelCache::Handle segmenter;
  SceneChild row;
};
absl::StatusOr<ResidentModel> LoadModel(const ServiceContext& context, const std::string& name,
                                        const std::string& field);
// For what is asked of its features. FAILED_PRECONDITION: it was trained without masks.
absl::StatusOr<ResidentModel> LoadModelWithFeatures(const ServiceContext& context,
                                                    const std::string& name,
                                                    const std::string& field);
absl::Status CheckFeatures(const ResidentModel& model);

// Takes `bytes` of the host's memory for an answer about a model of the scene, out of the same
// budget and share as its models. RESOURCE_EXHAUSTED: they do not come free. Blocks.
absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeAnswerMemory(const ServiceContext& context,
                                                                 const std::string& scene,
                                                                 int64_t bytes);

// Key of a model in the cache.
std::string ResidentKey(const ModelRow& model);

}  // namespace pepeseg
