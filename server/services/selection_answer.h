#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/selection_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"

namespace pepeseg {

// Answers SelectionService's calls. All of them block; Create and Combine also
// load a model and compute, so they belong on the query pool.
class SelectionAnswers {
 public:
  // Both must outlive it.
  SelectionAnswers(ModelLoader& models, Selections& selections)
      : models_(models), selections_(selections) {}

  absl::Status Create(const UnaryCall& call, const v1::CreateSelectionRequest& request,
                      v1::Selection* response) const;
  absl::Status Combine(const v1::CombineSelectionsRequest& request, v1::Selection* response) const;
  absl::Status Undo(const v1::UndoSelectionRequest& request, v1::Selection* response) const;
  absl::Status Get(const v1::GetSelectionRequest& request, v1::Selection* response) const;
  absl::Status List(const v1::ListSelectionsRequest& request,
                    v1::ListSelectionsResponse* response) const;
  absl::Status Delete(const v1::DeleteSelectionRequest& request) const;

 private:
  // Return the Gaussians that a request selects, by a prompt or as a segment.
  absl::StatusOr<GaussianSet> SelectPrompted(const UnaryCall& call, const ResidentModel& model,
                                             const v1::CreateSelectionRequest& request) const;
  absl::StatusOr<GaussianSet> SelectSource(const UnaryCall& call, const ResidentModel& model,
                                           const v1::CreateSelectionRequest& request) const;

  ModelLoader& models_;
  Selections& selections_;
};

}  // namespace pepeseg
