// A client's calls about datasets.
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/cpp/ask.h"
#include "clients/cpp/checksums.h"
#include "clients/cpp/client.h"
#include "clients/cpp/send_files.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

using Datasets = v1::DatasetService::Stub;

absl::StatusOr<v1::CreateUploadRequest> Declare(const std::string& scene,
                                                const DatasetFolder& folder) {
  v1::CreateUploadRequest request;
  request.set_parent(scene);
  for (const FolderFile& file : folder.files) {
    ASSIGN_OR_RETURN(const FileDigest digest, DigestFile(file.path));
    v1::FileDeclaration* declaration = request.add_files();
    declaration->set_path(file.name);
    declaration->set_kind(file.kind);
    declaration->set_size(digest.size);
    declaration->set_sha256(digest.sha256);
  }
  return request;
}

// The same for the same files, so that a program finds an upload again that it has begun before.
std::string RequestIdOf(const v1::CreateUploadRequest& request) {
  Sha256 digest;
  for (const v1::FileDeclaration& file : request.files()) {
    digest.Add(absl::StrCat(file.path(), "\n", static_cast<int>(file.kind()), " ", file.size(), " ",
                            file.sha256(), "\n"));
  }
  return absl::StrCat("files-", digest.Finish());
}

// One that goes on, or a new one where that was sealed.
absl::StatusOr<v1::Upload> Open(Datasets& datasets, v1::CreateUploadRequest request) {
  request.set_request_id(RequestIdOf(request));
  ASSIGN_OR_RETURN(v1::Upload upload,
                   Ask(datasets, &Datasets::CreateUpload, request.parent(), request));
  if (!upload.sealed()) return upload;
  request.set_request_id(NewRequestId());
  return Ask(datasets, &Datasets::CreateUpload, request.parent(), request);
}

}  // namespace

absl::StatusOr<v1::Dataset> Client::Upload(const std::string& scene, const DatasetFolder& folder,
                                           const UploadProgress& progress) const {
  ASSIGN_OR_RETURN(v1::CreateUploadRequest request, Declare(SceneName(scene), folder));
  ASSIGN_OR_RETURN(v1::Upload upload, Open(*datasets_, std::move(request)));
  return FinishUpload(*datasets_, std::move(upload), folder, progress);
}

absl::StatusOr<v1::Dataset> Client::NewestDataset(const std::string& scene) const {
  v1::ListDatasetsRequest request;
  request.set_parent(SceneName(scene));
  ASSIGN_OR_RETURN(const v1::ListDatasetsResponse all,
                   AskAllPages(*datasets_, &Datasets::ListDatasets, scene, request));
  if (all.datasets_size() > 0) return all.datasets(all.datasets_size() - 1);
  return absl::FailedPreconditionError(
      absl::StrCat(request.parent(), " has no dataset yet: an upload brings one"));
}

absl::StatusOr<Client::Photograph> Client::GetPhotograph(
    const v1::GetPhotographRequest& request) const {
  Call call(SceneOf(request.parent()), kCallSeconds);
  const auto stream = datasets_->GetPhotograph(call, request);
  Photograph photograph;
  v1::GetPhotographResponse part;
  while (stream->Read(&part)) {
    if (part.has_header()) photograph.header = part.header();
    if (!part.has_chunk()) continue;
    const std::string& data = part.chunk().data();
    if (Crc32c(data) != part.chunk().crc32c()) {
      call.Cancel();
      return absl::DataLossError(absl::StrCat("bytes from ", photograph.bytes.size(),
                                              " on of the photograph fail their checksum"));
    }
    photograph.bytes += data;
  }
  RETURN_IF_ERROR(FromGrpc(stream->Finish()));
  if (static_cast<int64_t>(photograph.bytes.size()) != photograph.header.num_bytes()) {
    return absl::DataLossError(
        absl::StrCat("the photograph is cut short: ", photograph.bytes.size(), " of ",
                     photograph.header.num_bytes(), " bytes"));
  }
  return photograph;
}

}  // namespace pepeseg::client
