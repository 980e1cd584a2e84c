#include "server/worker_protocol/snapshot_file.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/checkpoint.h"
#include "core/model_files/manifest.h"
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

// Opens a folder of an attempt, a path below work/.
absl::StatusOr<BeneathFolder> OpenBelow(const BeneathFolder& work,
                                        const std::filesystem::path& folder) {
  return work.OpenFolder(folder.parent_path().filename() / folder.filename());
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

std::optional<SnapshotStamp> FindSnapshot(const JobFolder& folder, int64_t fence) {
  const absl::StatusOr<BeneathFolder> work = BeneathFolder::Open(folder.work());
  if (!work.ok()) return std::nullopt;
  if (const auto facts = work->Look(folder.snapshot(fence).filename())) {
    return SnapshotStamp{fence, facts->modified, facts->num_bytes};
  }
  const absl::StatusOr<BeneathFolder> early = OpenBelow(*work, folder.early(fence));
  if (!early.ok()) return std::nullopt;
  const auto facts = early->Look(kManifestName);
  if (!facts) return std::nullopt;
  return SnapshotStamp{fence, facts->modified, facts->num_bytes, /*is_early=*/true};
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

absl::Status CopySnapshotGaussians(const JobFolder& folder, const SnapshotStamp& stamp,
                                   const std::filesystem::path& to, int64_t max_bytes) {
  ASSIGN_OR_RETURN(const BeneathFolder work, BeneathFolder::Open(folder.work()));
  absl::StatusOr<BeneathFolder> model = OpenBelow(
      work, stamp.is_early ? folder.early(stamp.fence) : folder.reconstruction(stamp.fence));
  if (absl::IsNotFound(model.status()) && !stamp.is_early) {
    model = OpenBelow(work, folder.given(stamp.fence));
  }
  RETURN_IF_ERROR(model.status());
  return model->CopyFiles(to, max_bytes);
}

}  // namespace pepeseg
