#include "clients/cli/connection.h"

#include <chrono>
#include <random>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/failure.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
Connection::Connection(const std::shared_ptr<grpc::Channel>& channel) {
  scenes = v1::SceneService::NewStub(channel);
  datasets = v1::DatasetService::NewStub(channel);
  jobs = v1::JobService::NewStub(channel);
  segmentation = v1::SegmentationService::NewStub(channel);
}

Call::Call(const std::string& scene, double seconds) {
  if (!scene.empty()) context_.AddMetadata("x-scene", SceneName(scene).substr(7));
  if (seconds > 0) {
    context_.set_deadline(std::chrono::system_clock::now() +
                          std::chrono::milliseconds(static_cast<int64_t>(seconds * 1000)));
  }
}

std::string SceneName(const std::string& scene) {
  return absl::StartsWith(scene, "scenes/") ? scene : absl::StrCat("scenes/", scene);
}

std::string JobName(const std::string& job) {
  return absl::StartsWith(job, "jobs/") ? job : absl::StrCat("jobs/", job);
}

std::string SceneOf(const std::string& resource) {
  const size_t id_start = std::string("scenes/").size();
  return resource.substr(0, resource.find('/', id_start));
}

std::string NewRequestId() {
  std::random_device random;
  std::string id;
  for (int word = 0; word < 4; ++word) absl::StrAppendFormat(&id, "%08x", random());
  return id;
}

absl::StatusOr<v1::Dataset> NewestDataset(const Connection& connection, const std::string& scene) {
  v1::ListDatasetsRequest request;
  request.set_parent(scene);
  request.set_page_size(1000);
  v1::Dataset newest;
  do {
    v1::ListDatasetsResponse page;
    Call call(scene, kCallSeconds);
    RETURN_IF_ERROR(FromGrpc(connection.datasets->ListDatasets(call, request, &page)));
    if (page.datasets_size() > 0) newest = page.datasets(page.datasets_size() - 1);
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  if (newest.name().empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(scene, " has no dataset yet: `pepeseg upload` brings one"));
  }
  return newest;
}

absl::StatusOr<std::vector<v1::View>> AllViews(const Connection& connection,
                                               const std::string& model) {
  v1::ListViewsRequest request;
  request.set_parent(model);
  request.set_page_size(1000);
  std::vector<v1::View> views;
  do {
    v1::ListViewsResponse page;
    Call call(SceneOf(model), kCallSeconds);
    RETURN_IF_ERROR(FromGrpc(connection.scenes->ListViews(call, request, &page)));
    views.insert(views.end(), page.views().begin(), page.views().end());
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return views;
}

}  // namespace pepeseg::cli
