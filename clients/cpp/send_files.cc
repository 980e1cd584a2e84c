#include "clients/cpp/send_files.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cpp/ask.h"
#include "clients/cpp/checksums.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;
constexpr absl::Duration kFirstPause = absl::Milliseconds(250);
constexpr absl::Duration kLongestPause = absl::Seconds(8);
constexpr absl::Duration kPatience = absl::Seconds(60);

using Datasets = v1::DatasetService::Stub;
using FileStream = std::unique_ptr<grpc::ClientWriter<v1::WriteFilesRequest>>;

// A file to be sent from byte `offset` on.
struct Rest {
  const FolderFile* file = nullptr;
  int64_t offset = 0;
};

// What is left of an upload, and how many of its bytes the server has.
struct Work {
  std::string upload;
  std::vector<Rest> rests;
  int64_t num_bytes = 0;
  int64_t num_there = 0;
};

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
    work.rests.push_back({files[name], committed[name]});
    work.num_there -= size - committed[name];
  }
  return work;
}

// False when the server ended the stream; its Finish tells why.
absl::StatusOr<bool> SendFile(FileStream& stream, const std::string& upload, const Rest& rest,
                              absl::FunctionRef<void(int64_t)> sent) {
  std::ifstream bytes(rest.file->path, std::ios::binary);
  if (!bytes) return LocalFileError("read", rest.file->path, errno);
  bytes.seekg(rest.offset);
  v1::WriteFilesRequest request;
  request.mutable_header()->set_upload(upload);
  request.mutable_header()->set_path(rest.file->name);
  request.mutable_header()->set_offset(rest.offset);
  // A small file goes out in one packet with its header and its end.
  const auto buffered = grpc::WriteOptions().set_buffer_hint();
  if (!stream->Write(request, buffered)) return false;
  std::string piece(kChunkBytes, '\0');
  while (bytes) {
    bytes.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto size = static_cast<size_t>(bytes.gcount());
    if (size == 0) break;
    v1::WriteFilesRequest::Chunk* chunk = request.mutable_chunk();
    chunk->set_data(piece.data(), size);
    chunk->set_crc32c(Crc32c(chunk->data()));
    const bool last = size < piece.size();
    if (!stream->Write(request, last ? buffered : grpc::WriteOptions())) return false;
    sent(static_cast<int64_t>(size));
  }
  request.mutable_end();
  return stream->Write(request);
}

void Tell(const UploadProgress& progress, const std::string& what) {
  if (progress.note) progress.note(what);
}

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

// What another try may mend: no connection, the file's earlier stream, another offset by then.
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

// Pauses between tries, longer ones while nothing comes through.
class Patience {
 public:
  // False: it is at its end.
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

absl::StatusOr<v1::Dataset> TryOnce(Datasets& datasets, const Work& work,
                                    const UploadProgress& progress) {
  if (!work.rests.empty()) RETURN_IF_ERROR(SendAll(datasets, work, progress));
  return Seal(datasets, work.upload);
}

}  // namespace

absl::StatusOr<v1::Dataset> FinishUpload(v1::DatasetService::Stub& datasets, v1::Upload upload,
                                         const DatasetFolder& folder,
                                         const UploadProgress& progress) {
  if (upload.missing_files_size() == 0) Tell(progress, "the server has every file already");
  ASSIGN_OR_RETURN(Work work, PlanWork(upload, folder));
  Patience patience;
  while (true) {
    absl::StatusOr<v1::Dataset> dataset = TryOnce(datasets, work, progress);
    if (dataset.ok() || !MayPass(dataset.status())) return dataset;
    Tell(progress, absl::StrCat("broken off: ", dataset.status().message(), "; trying again"));
    absl::StatusOr<v1::Upload> now = absl::UnavailableError("");
    while (!now.ok() && MayPass(now.status())) {
      if (!patience.Pause(work.num_there)) return dataset.status();
      now = GetUpload(datasets, work.upload);
    }
    RETURN_IF_ERROR(now.status());
    ASSIGN_OR_RETURN(work, PlanWork(*now, folder));
  }
}

}  // namespace pepeseg::client
