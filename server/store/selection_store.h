#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Selections of a scene's Gaussians. A selection's file is written before its record, and both are
// named by a number that is taken first. See Store for what holds for all calls.
class SelectionStore {
 public:
  SelectionStore(Database& database, const Quota& defaults)
      : database_(database), defaults_(defaults) {}

  absl::StatusOr<int64_t> TakeSelectionNumber(const SceneRef& scene);
  // Returns what an earlier CreateSelection with this request_id made, so that a retry need not
  // compute it again; nullopt if there was none or request_id is empty. ALREADY_EXISTS: the earlier
  // one has another digest.
  absl::StatusOr<std::optional<SelectionRecord>> FindSelectionOfRequest(
      const SceneRef& scene, const std::string& request_id, const std::string& request_digest);
  // Creates a selection from all fields but create_time. If the returned number differs from the
  // given one, it is that of a selection that the same request_id made meanwhile. NOT_FOUND: the
  // model or the base is gone. RESOURCE_EXHAUSTED: the project's quota of stored bytes.
  absl::StatusOr<SelectionRecord> CreateSelection(const SelectionRecord& selection);
  absl::StatusOr<SelectionRecord> GetSelection(const SceneRef& scene, int64_t number);
  // Lists selections, newest first.
  absl::StatusOr<Page<SelectionRecord>> ListSelections(const SceneRef& scene,
                                                       const PageRequest& page);
  // Deletes a selection; those made from it stay.
  absl::Status DeleteSelection(const SceneRef& scene, int64_t number);

 private:
  Database& database_;
  const Quota& defaults_;  // limits of projects without values of their own
};

}  // namespace pepeseg
