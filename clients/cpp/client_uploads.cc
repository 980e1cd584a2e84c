// The Client's methods about datasets.
//
// An upload declares all files with their digests; the server answers which bytes it lacks. They
// are sent over one stream, file after file, each from the byte at which the server's copy ends.
// When the stream breaks, GetUpload reports what is there by then, and a new stream sends the rest.
#include <algorithm>
#include <cerrno>
#include <fstream>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cpp/call.h"
#include "clients/cpp/client.h"
#include "clients/cpp/digest.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;
constexpr absl::Duration kFirstPause = absl::Milliseconds(250);  // doubled after each attempt
constexpr absl::Duration kLongestPause = absl::Seconds(8);
constexpr absl::Duration kPatience = absl::Seconds(60);  // without a new byte on the server

using Datasets = v1::DatasetService::Stub;
using FileStream = std::unique_ptr<grpc::ClientWriter<v1::WriteFilesRequest>>;

// A file of which the server lacks the bytes from `offset` on.
struct Rest {
  const FolderFile* file = nullptr;
  int64_t offset = 0;
};

// What is left to send of an upload.
struct Work {
  std::string upload;  // resource name
  std::vector<Rest> rests;
  int64_t num_bytes = 0;  // of the whole dataset
  int64_t num_there = 0;  // of these, on the server
};

// Returns what the server lacks by `upload`. INTERNAL: the server names a file that `folder` does
// not have.
absl::StatusOr<Work> PlanWork(const v1::Upload& upload, const DatasetFolder& folder) {
  std::unordered_map<std::string, const FolderFile*> files;
  for (const FolderFile& file : folder.files) files[file.name] = &file;
  std::unordered_map<std::string, int64_t> committed;
  for (const auto& partial : upload.partial_files()) {
    committed[partial.path()] = partial.committed_bytes();
  }
  Work work{upload.name(), {}, upload.num_bytes(), upload.num_bytes()};
  for (const std::string& name : upload.missing_files()) {
    if (files.count(name) == 0) {
      return absl::InternalError(absl::StrCat("the server asks for an unknown file: ", name));
    }
    std::error_code error;
    const auto size = static_cast<int64_t>(std::filesystem::file_size(files[name]->path, error));
    if (error) return LocalFileError("read", files[name]->path, error.value());
    // A missing file without a partial copy starts at 0, which operator[] inserts.
    work.rests.push_back({files[name], committed[name]});
    work.num_there -= size - committed[name];
  }
  return work;
}

// Sends header, chunks and end of a file; calls `sent` with the bytes of each chunk. Returns false
// if the server has ended the stream: Finish then returns the reason.
absl::StatusOr<bool> SendFile(FileStream& stream, const std::string& upload, const Rest& rest,
                              absl::FunctionRef<void(int64_t)> sent) {
  std::ifstream bytes(rest.file->path, std::ios::binary);
  if (!bytes) return LocalFileError("read", rest.file->path, errno);
  bytes.seekg(rest.offset);
  v1::WriteFilesRequest request;
  request.mutable_header()->set_upload(upload);
  request.mutable_header()->set_path(rest.file->name);
  request.mutable_header()->set_offset(rest.offset);
  // Buffered, so that a small file leaves in one packet with its header and end.
  const auto buffered = grpc::WriteOptions().set_buffer_hint();
  if (!stream->Write(request, buffered)) return false;
  std::string piece(kChunkBytes, '\0');
  while (bytes) {
    bytes.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto size = static_cast<size_t>(bytes.gcount());
    if (size == 0) break;
    request.set_chunk(piece.data(), size);
    // A chunk that may be the last leaves together with the end.
    const bool last = size < piece.size();
    if (!stream->Write(request, last ? buffered : grpc::WriteOptions())) return false;
    sent(static_cast<int64_t>(size));
  }
  // The server compares size and SHA-256 with the declaration when the end arrives.
  request.mutable_end();
  return stream->Write(request);
}

void Report(const UploadProgress& progress, const std::string& what) {
  if (progress.note) progress.note(what);
}

// Sends all files of `work` over one stream. Errors of local files win over those of the stream.
absl::Status SendAll(Datasets& datasets, const Work& work, const UploadProgress& progress) {
  v1::WriteFilesResponse response;
  Call call(SceneOf(work.upload), 0);
  FileStream stream = datasets.WriteFiles(call, &response);
  int64_t bytes = work.num_there;
  for (const Rest& rest : work.rests) {
    const auto went = SendFile(stream, work.upload, rest, [&](int64_t size) {
      bytes += size;
      if (progress.bytes) progress.bytes(bytes, work.num_bytes);
    });
    if (!went.ok()) {
      call.Cancel();
      (void)stream->Finish();
      return went.status();
    }
    if (!*went) break;
  }
  stream->WritesDone();
  RETURN_IF_ERROR(FromGrpc(stream->Finish()));
  if (progress.bytes) progress.bytes(work.num_bytes, work.num_bytes);
  return absl::OkStatus();
}

absl::StatusOr<v1::Upload> GetUpload(Datasets& datasets, const std::string& upload) {
  v1::GetUploadRequest request;
  request.set_name(upload);
  return Ask(datasets, &Datasets::GetUpload, SceneOf(upload), request);
}

absl::StatusOr<v1::Dataset> Seal(Datasets& datasets, const std::string& upload) {
  v1::SealUploadRequest request;
  request.set_name(upload);
  return Ask(datasets, &Datasets::SealUpload, SceneOf(upload), request);
}

// Returns true if another attempt may succeed: the connection was lost (UNAVAILABLE, CANCELLED), an
// earlier stream still holds the file (ABORTED), or its offset has changed (OUT_OF_RANGE).
bool MayPass(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kCancelled:
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kOutOfRange:
      return true;
    default:
      return false;
  }
}

// Pauses between attempts, which grow while no byte arrives.
class Patience {
 public:
  // Sleeps and returns true; returns false at once if `num_there`, the bytes on the server, has not
  // grown for kPatience.
  bool Pause(int64_t num_there) {
    if (num_there > most_) {
      most_ = num_there;
      pause_ = kFirstPause;
      since_ = absl::Now();
    }
    if (absl::Now() - since_ > kPatience) return false;
    absl::SleepFor(pause_);
    pause_ = std::min(2 * pause_, kLongestPause);
    return true;
  }

 private:
  int64_t most_ = -1;
  absl::Duration pause_ = kFirstPause;
  absl::Time since_ = absl::Now();
};

// Sends what is left and seals the upload.
absl::StatusOr<v1::Dataset> TryOnce(Datasets& datasets, const Work& work,
                                    const UploadProgress& progress) {
  if (!work.rests.empty()) RETURN_IF_ERROR(SendAll(datasets, work, progress));
  return Seal(datasets, work.upload);
}

// Sends what `upload` lacks and seals it, with as many attempts as that needs.
absl::StatusOr<v1::Dataset> FinishUpload(Datasets& datasets, v1::Upload upload,
                                         const DatasetFolder& folder,
                                         const UploadProgress& progress) {
  if (upload.missing_files_size() == 0) Report(progress, "the server has every file already");
  ASSIGN_OR_RETURN(Work work, PlanWork(upload, folder));
  Patience patience;
  while (true) {
    absl::StatusOr<v1::Dataset> dataset = TryOnce(datasets, work, progress);
    if (dataset.ok() || !MayPass(dataset.status())) return dataset;
    Report(progress, absl::StrCat("interrupted: ", dataset.status().message(), "; trying again"));
    absl::StatusOr<v1::Upload> now = absl::UnavailableError("");
    while (!now.ok() && MayPass(now.status())) {
      // The error of the upload is returned, not that of GetUpload: it says why the stream broke.
      if (!patience.Pause(work.num_there)) return dataset.status();
      now = GetUpload(datasets, work.upload);
    }
    RETURN_IF_ERROR(now.status());
    ASSIGN_OR_RETURN(work, PlanWork(*now, folder));
  }
}

// Returns the request that declares the files, without a request_id. Reads every file.
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

// Returns an id that depends on the declared files only, so that a later run of the program finds
// the upload that an earlier one began.
std::string RequestIdOf(const v1::CreateUploadRequest& request) {
  Sha256 digest;
  for (const v1::FileDeclaration& file : request.files()) {
    digest.Add(absl::StrCat(file.path(), "\n", static_cast<int>(file.kind()), " ", file.size(), " ",
                            file.sha256(), "\n"));
  }
  return absl::StrCat("files-", digest.Finish());
}

// Returns the unfinished upload of these files, or a new one.
absl::StatusOr<v1::Upload> Open(Datasets& datasets, v1::CreateUploadRequest request) {
  request.set_request_id(RequestIdOf(request));
  ASSIGN_OR_RETURN(v1::Upload upload,
                   Ask(datasets, &Datasets::CreateUpload, request.parent(), request));
  // A sealed upload is finished: uploading the same folder again makes a new dataset.
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

absl::Status Client::DeleteUpload(const std::string& upload) const {
  v1::DeleteUploadRequest request;
  request.set_name(upload);
  return Ask(*datasets_, &Datasets::DeleteUpload, SceneOf(upload), request).status();
}

absl::StatusOr<v1::Dataset> Client::GetDataset(const std::string& dataset) const {
  v1::GetDatasetRequest request;
  request.set_name(dataset);
  return Ask(*datasets_, &Datasets::GetDataset, SceneOf(dataset), request);
}

absl::StatusOr<v1::ListDatasetsResponse> Client::ListDatasets(const std::string& scene) const {
  v1::ListDatasetsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*datasets_, &Datasets::ListDatasets, scene, request);
}

absl::StatusOr<v1::Dataset> Client::NewestDataset(const std::string& scene) const {
  ASSIGN_OR_RETURN(const v1::ListDatasetsResponse all, ListDatasets(scene));
  if (all.datasets_size() > 0) return all.datasets(all.datasets_size() - 1);
  return absl::FailedPreconditionError(
      absl::StrCat(SceneName(scene), " has no dataset yet; upload one"));
}

absl::StatusOr<Client::Photograph> Client::GetPhotograph(
    const v1::GetPhotographRequest& request) const {
  Call call(SceneOf(request.parent()), kCallSeconds);
  const auto stream = datasets_->GetPhotograph(call, request);
  Photograph photograph;
  v1::GetPhotographResponse part;
  while (stream->Read(&part)) {
    if (part.has_header()) photograph.header = part.header();
    photograph.bytes += part.chunk();
  }
  RETURN_IF_ERROR(FromGrpc(stream->Finish()));
  if (static_cast<int64_t>(photograph.bytes.size()) != photograph.header.num_bytes()) {
    return absl::DataLossError(absl::StrCat("the photograph is incomplete: received ",
                                            photograph.bytes.size(), " of ",
                                            photograph.header.num_bytes(), " bytes"));
  }
  return photograph;
}

}  // namespace pepeseg::client
