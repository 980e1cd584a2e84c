#include "tests/system/fuzz/pose_index.h"

#include <fstream>
#include <iterator>
#include <utility>

#include "tests/system/fuzz/fuzz_target.h"

namespace pepeseg::fuzz {
namespace {

// The start and the end of a JPEG of 40x30 pixels, of which only the headers are read.
std::string SmallJpeg() {
  std::ifstream file(PEPESEG_FUZZ_CORPUS "/image_header/jpeg", std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

PoseIndex::PoseIndex(const std::string& poses) {
  const std::string& photo = photo_.Put(SmallJpeg());
  for (const char* name : {"images/a.jpg", "images/b.jpg", "images/sub/c.png"}) {
    files_.push_back({FileKind::kImage, name, photo});
  }
  files_.push_back({FileKind::kPoses, poses, poses_.Put("")});
  auto index = IndexDataset(files_);
  Expect(index.ok(), "an index of three photographs");
  index_ = *std::move(index);
}

const DatasetIndex& PoseIndex::Put(absl::string_view bytes) {
  poses_.Put(bytes);
  return index_;
}

}  // namespace pepeseg::fuzz
