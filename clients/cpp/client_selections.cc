// A client's calls about names for masks, and about Gaussians chosen.
#include <string>

#include "clients/cpp/ask.h"
#include "clients/cpp/client.h"

namespace pepeseg::client {

using Segmentation = v1::SegmentationService::Stub;

absl::StatusOr<v1::Label> Client::CreateLabel(v1::CreateLabelRequest request) const {
  request.set_parent(SceneName(request.parent()));
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*segmentation_, &Segmentation::CreateLabel, request.parent(), request);
}

absl::StatusOr<v1::ListLabelsResponse> Client::ListLabels(const std::string& scene) const {
  v1::ListLabelsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*segmentation_, &Segmentation::ListLabels, scene, request);
}

absl::Status Client::DeleteLabel(const std::string& label) const {
  v1::DeleteLabelRequest request;
  request.set_name(label);
  return Ask(*segmentation_, &Segmentation::DeleteLabel, SceneOf(label), request).status();
}

absl::StatusOr<v1::Selection> Client::Select(v1::SelectRequest request) const {
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*segmentation_, &Segmentation::Select, SceneOf(request.model()), request);
}

absl::StatusOr<v1::Selection> Client::CombineSelections(
    v1::CombineSelectionsRequest request) const {
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*segmentation_, &Segmentation::CombineSelections, SceneOf(request.first()), request);
}

absl::StatusOr<v1::Selection> Client::UndoSelection(const std::string& selection) const {
  v1::UndoSelectionRequest request;
  request.set_name(selection);
  return Ask(*segmentation_, &Segmentation::UndoSelection, SceneOf(selection), request);
}

absl::StatusOr<v1::Selection> Client::GetSelection(const std::string& selection) const {
  v1::GetSelectionRequest request;
  request.set_name(selection);
  return Ask(*segmentation_, &Segmentation::GetSelection, SceneOf(selection), request);
}

absl::StatusOr<v1::ListSelectionsResponse> Client::ListSelections(const std::string& scene) const {
  v1::ListSelectionsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*segmentation_, &Segmentation::ListSelections, scene, request);
}

absl::Status Client::DeleteSelection(const std::string& selection) const {
  v1::DeleteSelectionRequest request;
  request.set_name(selection);
  return Ask(*segmentation_, &Segmentation::DeleteSelection, SceneOf(selection), request).status();
}

}  // namespace pepeseg::client
