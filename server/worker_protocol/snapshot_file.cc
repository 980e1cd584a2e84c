#include "server/worker_protocol/snapshot_file.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/checkpoint.h"
#include "server/worker_protocol/beneath_folder.h"

namespace pepeseg {
namespace {

constexpr char kStage[] = "snapshot";

// The sections of the file.
struct Parts {
  int64_t num_steps = 0;
  std::string field;
};

// The only list of them, for writing and reading.
template <class AnyParts, class Visit>
void VisitSections(AnyParts& parts, const Visit& visit) {
  visit("num_steps", 1, parts.num_steps);
  visit("field", 1, parts.field);
}

std::string IdentityOf(const std::string& job, int64_t fence) {
  return absl::StrCat(job, "/", fence);
}

absl::StatusOr<SnapshotFile> Parse(const Checkpoint& file, const std::string& job, int64_t fence) {
  if (file.header.stage != kStage || file.header.identity != IdentityOf(job, fence)) {
    return absl::DataLossError(absl::StrCat("is of ", file.header.stage, " of ",
                                            file.header.identity, ", not a snapshot of ",
                                            IdentityOf(job, fence)));
  }
  Parts parts;
  const SectionReader reader(file.sections);
  VisitSections(parts, reader);
  RETURN_IF_ERROR(reader.Finish());
  if (file.header.step < 0 || parts.num_steps < file.header.step) {
    return absl::DataLossError(
        absl::StrCat("is of step ", file.header.step, " of ", parts.num_steps));
  }
  SnapshotFile snapshot = {job, fence, file.header.step, parts.num_steps, {}};
  ASSIGN_OR_RETURN(snapshot.field, ParseFeatureField(parts.field, "field"));
  return snapshot;
}

}  // namespace

absl::Status WriteSnapshotFile(const std::filesystem::path& path, const SnapshotFile& snapshot) {
  Parts parts = {snapshot.num_steps, {}};
  ASSIGN_OR_RETURN(parts.field, FormatFeatureField(snapshot.field, "field"));
  std::vector<CheckpointSection> sections;
  VisitSections(parts, SectionWriter{sections});
  return WriteCheckpoint(path, {kStage, IdentityOf(snapshot.job, snapshot.fence), snapshot.step},
                         sections);
}

std::optional<SnapshotStamp> FindSnapshotFile(const JobFolder& folder, int64_t fence) {
  const absl::StatusOr<BeneathFolder> work = BeneathFolder::Open(folder.work());
  if (!work.ok()) return std::nullopt;
  const auto facts = work->Look(folder.snapshot(fence).filename());
  if (!facts) return std::nullopt;
  return SnapshotStamp{fence, facts->modified, facts->num_bytes};
}

absl::StatusOr<SnapshotFile> ReadSnapshotFile(const JobFolder& folder, const std::string& job,
                                              int64_t fence, int64_t max_bytes) {
  const std::string name = folder.snapshot(fence).filename();
  ASSIGN_OR_RETURN(const BeneathFolder work, BeneathFolder::Open(folder.work()));
  ASSIGN_OR_RETURN(const std::string bytes, work.ReadFile(name, max_bytes));
  ASSIGN_OR_RETURN(const Checkpoint file,
                   ParseCheckpoint(std::vector<char>(bytes.begin(), bytes.end()), name));
  absl::StatusOr<SnapshotFile> snapshot = Parse(file, job, fence);
  if (snapshot.ok()) return snapshot;
  return absl::DataLossError(absl::StrCat(name, ": ", snapshot.status().message()));
}

absl::Status CopySnapshotGaussians(const JobFolder& folder, int64_t fence,
                                   const std::filesystem::path& to, int64_t max_bytes) {
  ASSIGN_OR_RETURN(const BeneathFolder work, BeneathFolder::Open(folder.work()));
  const std::filesystem::path attempt = folder.attempt(fence).filename();
  absl::StatusOr<BeneathFolder> model = work.OpenFolder(attempt / "reconstruct");
  if (absl::IsNotFound(model.status())) model = work.OpenFolder(attempt / "given");
  RETURN_IF_ERROR(model.status());
  return model->CopyFiles(to, max_bytes);
}

}  // namespace pepeseg
