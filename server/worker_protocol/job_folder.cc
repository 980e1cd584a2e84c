#include "server/worker_protocol/job_folder.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_file.h"
#include "server/worker_protocol/beneath_folder.h"
#include "server/worker_protocol/event_log.h"

namespace pepeseg {
namespace {

// A spec lists at most 20,000 files.
constexpr int64_t kMaxSpecBytes = 64 << 20;
// A result usually has about a kilobyte.
constexpr int64_t kMaxResultBytes = 1 << 20;

std::filesystem::path SpecPath(const std::filesystem::path& folder, int64_t fence) {
  return folder / absl::StrCat("spec-", fence, ".json");
}

std::string ResultName(int64_t fence) { return absl::StrCat("result-", fence, ".json"); }

std::string AttemptName(int64_t fence) { return absl::StrCat("attempt-", fence); }

// Removes the entries of a folder, except logs, JSON files and those named in `keep`.
void RemoveAllBut(const BeneathFolder& folder, const std::vector<std::string>& keep) {
  const auto entries = folder.List();
  if (!entries.ok()) return;
  for (const BeneathFolder::Entry& entry : *entries) {
    const std::string suffix = std::filesystem::path(entry.name).extension();
    const bool is_record = entry.is_file && (suffix == ".log" || suffix == ".json");
    // An entry that cannot be removed only costs space.
    const bool kept = is_record || std::find(keep.begin(), keep.end(), entry.name) != keep.end();
    if (!kept) folder.RemoveAll(entry.name).IgnoreError();
  }
}

}  // namespace

std::filesystem::path JobFolder::work() const { return path_ / kWorkFolder; }

std::filesystem::path JobFolder::attempt(int64_t fence) const {
  return work() / AttemptName(fence);
}

std::filesystem::path JobFolder::model(int64_t fence) const { return path_ / AttemptName(fence); }

std::filesystem::path JobFolder::frames(int64_t fence) const { return attempt(fence) / "frames"; }

std::filesystem::path JobFolder::poses(int64_t fence) const { return attempt(fence) / "poses"; }

std::filesystem::path JobFolder::early(int64_t fence) const { return attempt(fence) / "early"; }

std::filesystem::path JobFolder::reconstruction(int64_t fence) const {
  return attempt(fence) / "reconstruct";
}

std::filesystem::path JobFolder::given(int64_t fence) const { return attempt(fence) / "given"; }

std::filesystem::path JobFolder::checkpoints(int64_t fence) const {
  return attempt(fence) / "checkpoints";
}

std::filesystem::path JobFolder::snapshot(int64_t fence) const {
  return work() / absl::StrCat("snapshot-", fence);
}

std::filesystem::path JobFolder::heartbeat(int64_t fence) const {
  return work() / absl::StrCat("pulse-", fence);
}

std::filesystem::path JobFolder::lease(int64_t fence) const {
  return path_ / absl::StrCat("lease-", fence);
}

absl::Status JobFolder::Make() const {
  std::error_code error;
  std::filesystem::create_directories(work(), error);
  return error ? FileError(work(), "create", error.value()) : absl::OkStatus();
}

bool JobFolder::HasSaved(int64_t fence) const {
  const absl::StatusOr<BeneathFolder> work = BeneathFolder::Open(this->work());
  if (!work.ok()) return false;
  // A stage's result counts once its manifest exists, which is written last.
  for (const char* stage : {"frames", "poses", "reconstruct"}) {
    if (work->HasFile(AttemptName(fence) / std::filesystem::path(stage) / kManifestName)) {
      return true;
    }
  }
  const auto folder = work->OpenFolder(AttemptName(fence) / std::filesystem::path("checkpoints"));
  if (!folder.ok()) return false;
  const auto entries = folder->List();
  return entries.ok() &&
         std::any_of(entries->begin(), entries->end(), [](const BeneathFolder::Entry& entry) {
           return entry.is_file && entry.name.ends_with(".ckpt");
         });
}

void JobFolder::RemoveWorkingFiles(const std::string& keep) const {
  const absl::StatusOr<BeneathFolder> folder = BeneathFolder::Open(path_);
  if (!folder.ok()) return;
  const absl::StatusOr<BeneathFolder> work = folder->OpenFolder(kWorkFolder);
  if (work.ok()) RemoveAllBut(*work, {});
  RemoveAllBut(*folder, {keep, kWorkFolder});
}

absl::StatusOr<int64_t> JobFolder::TakeModel(int64_t fence) const {
  const std::string name = AttemptName(fence);
  ASSIGN_OR_RETURN(const BeneathFolder folder, BeneathFolder::Open(path_));
  if (const absl::Status there = folder.OpenFolder(name).status(); !there.ok()) {
    if (!absl::IsNotFound(there)) return there;
    ASSIGN_OR_RETURN(const BeneathFolder work, folder.OpenFolder(kWorkFolder));
    if (renameat2(work.descriptor(), name.c_str(), folder.descriptor(), name.c_str(),
                  RENAME_NOREPLACE) != 0) {
      return FileError(model(fence), "take the result", errno);
    }
    RETURN_IF_ERROR(SyncFolder(this->work()));
    RETURN_IF_ERROR(SyncFolder(path_));
  }
  // Checks the folder after the move: before it, a process of the worker could still change it.
  const absl::StatusOr<BeneathFolder> taken = folder.OpenFolder(name);
  absl::StatusOr<int64_t> num_bytes = taken.ok() ? taken->CheckPlain() : taken.status();
  if (absl::IsFailedPrecondition(num_bytes.status())) {
    folder.RemoveAll(name).IgnoreError();
    return absl::FailedPreconditionError(
        absl::StrCat("the worker's result is not taken: ", num_bytes.status().message()));
  }
  return num_bytes;
}

// Only a worker that is started by hand needs it: the supervisor names the fence.
int64_t JobFolder::NewestFence() const {
  int64_t newest = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(path_, error), end; !error && entry != end;
       entry.increment(error)) {
    std::string name = entry->path().filename().string();
    int64_t fence = 0;
    if (!name.starts_with("spec-") || entry->path().extension() != ".json") continue;
    name = entry->path().stem().string().substr(5);
    if (absl::SimpleAtoi(name, &fence)) newest = std::max(newest, fence);
  }
  return newest;
}

absl::Status JobFolder::WriteSpec(const JobSpec& spec) const {
  ASSIGN_OR_RETURN(const std::string text, FormatJobSpec(spec));
  return WriteFileAtomically(SpecPath(path_, spec.fence), text);
}

absl::StatusOr<JobSpec> JobFolder::ReadSpec(int64_t fence) const {
  const std::filesystem::path path = SpecPath(path_, fence);
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, path.string(), kMaxSpecBytes));
  return ParseJobSpec(path, text);
}

absl::Status JobFolder::WriteResult(int64_t fence, const JobResult& result) const {
  return WriteFileAtomically(work() / ResultName(fence), FormatJobResult(result));
}

absl::StatusOr<JobResult> JobFolder::ReadResult(int64_t fence) const {
  ASSIGN_OR_RETURN(const BeneathFolder work, BeneathFolder::Open(this->work()));
  const std::string name = ResultName(fence);
  const absl::StatusOr<std::string> text = work.ReadFile(name, kMaxResultBytes);
  if (absl::IsFailedPrecondition(text.status())) {
    return absl::DataLossError(text.status().message());
  }
  RETURN_IF_ERROR(text.status());
  return ParseJobResult(name, *text);
}

absl::Status CheckModelFolder(const std::filesystem::path& data,
                              const std::filesystem::path& model) {
  ASSIGN_OR_RETURN(const BeneathFolder folder, BeneathFolder::Open(data));
  const absl::StatusOr<BeneathFolder> files = folder.OpenFolder(model);
  const absl::Status status =
      files.ok() ? files->CheckPlain(/*other_names=*/true).status() : files.status();
  // Other errors are left to whoever reads the model next.
  return absl::IsFailedPrecondition(status) ? absl::DataLossError(status.message())
                                            : absl::OkStatus();
}

}  // namespace pepeseg
