#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "core/find/appearance.h"
#include "core/find/scene_segments.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Keeps the segments of the models that were looked at last, seen in views, and how they look:
// about 20 MB each, at most `max_bytes` of host memory in all, which are not part of the budget of
// the models. A model that takes more alone is looked at again with each call. Thread safe; one
// model is looked at at a time.
class SeenModels {
 public:
  explicit SeenModels(int64_t max_bytes = int64_t{64} << 20) : max_bytes_(max_bytes) {}

  // Returns the segments of the decomposition at kPieceDecompositionScales. Errors are those of
  // Decompose and of SeeSegments.
  absl::StatusOr<std::shared_ptr<const SceneSegments>> Segments(const ResidentModel& model,
                                                                const WantedCheck& check);
  // Returns how these segments look. Errors are also those of the encoder.
  absl::StatusOr<std::shared_ptr<const Appearance>> Looks(const ResidentModel& model,
                                                          ImageEncoder& encoder,
                                                          const WantedCheck& check);
  // Returns the bytes of what is kept.
  int64_t bytes() const;

 private:
  struct Seen {
    std::string key;
    std::shared_ptr<const SceneSegments> segments;
    std::shared_ptr<const Appearance> looks;  // null: not asked for yet
    int64_t bytes = 0;                        // as counted in bytes_
  };
  // Takes what is kept of a model out of the list, or looks at its segments. With mutex_ held, as
  // Keep.
  absl::StatusOr<Seen> Take(const ResidentModel& model, const WantedCheck& check);
  // Puts it to the front of the list, in place of the last ones if need be.
  void Keep(Seen seen);

  const int64_t max_bytes_;
  mutable std::mutex mutex_;
  std::list<Seen> recent_;  // the most recent first; guarded by mutex_, as the following
  int64_t bytes_ = 0;       // of recent_
};

// Returns what a view shows of the segments that Segments has returned.
absl::StatusOr<SeenView> SeeViewOf(const SceneModel& model, const SceneSegments& all,
                                   const ModelView& view);

}  // namespace pepeseg
