#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "core/find/appearance.h"
#include "core/find/scene_segments.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Keeps the segments of the two models that were looked at last, seen in views, and how they look:
// about 15 MB of host memory each. Thread safe; one model is looked at at a time.
class SeenModels {
 public:
  // Returns the segments of the decomposition at the default scales. Errors are those of Decompose
  // and of SeeSegments.
  absl::StatusOr<std::shared_ptr<const SceneSegments>> Segments(const ResidentModel& model,
                                                                const WantedCheck& check);
  // Returns how these segments look. Errors are also those of the encoder.
  absl::StatusOr<std::shared_ptr<const Appearance>> Looks(const ResidentModel& model,
                                                          ImageEncoder& encoder,
                                                          const WantedCheck& check);

 private:
  struct Seen {
    std::string key;
    std::shared_ptr<const SceneSegments> segments;
    std::shared_ptr<const Appearance> looks;  // null: not asked for yet
  };
  // Returns the entry of a model, with its segments. With mutex_ held.
  absl::StatusOr<Seen*> Find(const ResidentModel& model, const WantedCheck& check);

  std::mutex mutex_;
  std::list<Seen> recent_;  // the most recent first; guarded by mutex_
};

// Returns what a view shows of the segments that Segments has returned.
absl::StatusOr<SeenView> SeeViewOf(const SceneModel& model, const SceneSegments& all,
                                   const ModelView& view);

}  // namespace pepeseg
