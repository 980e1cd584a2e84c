#include "server/services/file_header.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/api/convert.h"

namespace pepeseg {

DatasetFile StoredFile(const DatasetFileRecord& record, std::filesystem::path blob) {
  const auto kind = FileKindFromProto(static_cast<v1::FileKind>(record.kind));
  return {kind.value_or(FileKind::kVideo), record.path, std::move(blob)};
}

bool HasHeader(const DatasetFileRecord& file) {
  return HasFacts(StoredFile(file, "").kind, file.path);
}

absl::Status ReadFileHeader(const std::filesystem::path& blob, DatasetFileRecord& file) {
  if (!HasHeader(file)) return absl::OkStatus();
  const absl::StatusOr<FileFacts> facts = ReadFileFacts(StoredFile(file, blob));
  // Only a file whose contents are at fault is refused for good; an error of the disk is returned,
  // so that the header is read again.
  if (absl::IsInvalidArgument(facts.status())) {
    file.header = HeaderState::kRefused;
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(facts.status());
  file.header = HeaderState::kRead;
  file.width = facts->width;
  file.height = facts->height;
  file.num_points = facts->num_points;
  return absl::OkStatus();
}

absl::Status RefusalOf(const std::filesystem::path& blob, const DatasetFileRecord& file) {
  absl::Status refusal = ReadFileFacts(StoredFile(file, blob)).status();
  if (!refusal.ok()) return refusal;
  return absl::InvalidArgumentError(absl::StrCat(file.path, ": its header was refused"));
}

int64_t CountSegmentMasks(const BlobStore& blobs, const std::string& project,
                          const std::vector<DatasetFileRecord>& files) {
  // Parsing takes about 20 ms for each MiB, and answers to GetDataset wait for it.
  constexpr int64_t kMostReferences = int64_t{8} << 20;
  std::vector<DatasetFile> dataset;
  for (const DatasetFileRecord& record : files) {
    if (record.size > kMostReferences && record.kind == v1::FILE_KIND_POSES) continue;
    dataset.push_back(StoredFile(record, blobs.Path({project, record.sha256})));
  }
  return pepeseg::CountSegmentMasks(dataset);
}

}  // namespace pepeseg
