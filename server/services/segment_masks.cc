#include "server/services/segment_masks.h"

#include <utility>

#include "core/dataset/dataset_index.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/api/convert.h"

namespace pepeseg {
namespace {

// Parsing takes about 20 ms for each MiB, and answers to GetDataset wait for it.
constexpr int64_t kMostReferences = int64_t{8} << 20;

}  // namespace

int64_t CountSegmentMasks(const BlobStore& blobs, const std::string& project,
                          const std::vector<DatasetFileRow>& files) {
  std::vector<DatasetFile> dataset;
  for (const DatasetFileRow& row : files) {
    const auto kind = FileKindFromProto(static_cast<v1::FileKind>(row.kind));
    if (!kind.ok()) continue;
    DatasetFile file = {*kind, row.path, {}};
    if (*kind == FileKind::kPoses) {
      if (row.size > kMostReferences) continue;
      file.path = blobs.Path({project, row.sha256});
    }
    dataset.push_back(std::move(file));
  }
  return pepeseg::CountSegmentMasks(dataset);
}

}  // namespace pepeseg
