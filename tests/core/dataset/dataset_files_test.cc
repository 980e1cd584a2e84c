#include <gtest/gtest.h>

#include "core/dataset/import.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::TempFolder;
using testing::WriteBytes;

TEST(ListDataset, FindsTheKindOfEachFileAndIgnoresTheRest) {
  const TempFolder folder;
  for (const char* name :
       {"images/b.JPG",         "images/sub/a.webp",    "images/sub/b.HEIC", "images/notes.txt",
        "sparse/0/cameras.bin", "sparse/0/project.ini", "sparse/images.txt", "sparse/1/cameras.bin",
        "sparse/x/cameras.bin", "images/._b.JPG",       "masks/b.json",      "masks/sub/a.png",
        "ignore_mask.png",      "ignore/b.png",         "depth/b.npy",       "depth/notes.txt",
        "disparity/b.PFM",      "points.ply",           "sparse_pc.ply",     "transforms.json",
        "sub/transforms.json",  "poses_bounds.npy",     "gaussians.ply",     "README.md",
        "labels/b.png"}) {
    WriteBytes(folder / name, "x");
  }
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(folder.path()));
  std::vector<std::pair<std::string, FileKind>> listed;
  for (const DatasetFile& file : files) {
    listed.emplace_back(file.name, file.kind);
    EXPECT_EQ(file.path, folder / file.name);
  }
  EXPECT_EQ(listed, (std::vector<std::pair<std::string, FileKind>>{
                        {"depth/b.npy", FileKind::kDepth},
                        {"disparity/b.PFM", FileKind::kDisparity},
                        {"gaussians.ply", FileKind::kGaussians},
                        {"ignore/b.png", FileKind::kIgnoreMask},
                        {"ignore_mask.png", FileKind::kIgnoreMask},
                        {"images/b.JPG", FileKind::kImage},
                        {"images/sub/a.webp", FileKind::kImage},
                        {"images/sub/b.HEIC", FileKind::kImage},
                        {"masks/b.json", FileKind::kMask},
                        {"masks/sub/a.png", FileKind::kMask},
                        {"points.ply", FileKind::kPoints},
                        {"poses_bounds.npy", FileKind::kPoses},
                        {"sparse/0/cameras.bin", FileKind::kPoses},
                        {"sparse/1/cameras.bin", FileKind::kPoses},
                        {"sparse/images.txt", FileKind::kPoses},
                        {"sparse_pc.ply", FileKind::kPoints},
                        {"transforms.json", FileKind::kPoses}}));
}

TEST(ListDataset, TreatsDepthAsDisparityIfRequested) {
  const TempFolder folder;
  for (const char* name : {"images/b.jpg", "depth/b.png"}) WriteBytes(folder / name, "x");
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(folder.path(), DepthPrior::Kind::kDisparity));
  EXPECT_EQ(files[0].kind, FileKind::kDisparity);
}

TEST(ListDataset, RejectsEmptyAndMissingFolders) {
  const TempFolder folder;
  EXPECT_STATUS(ListDataset(folder.path()), absl::StatusCode::kInvalidArgument, "no photographs");
  EXPECT_STATUS(ListDataset(folder.path()), absl::StatusCode::kInvalidArgument,
                folder.path().string());
  EXPECT_EQ(ListDataset(folder / "no").status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace pepeseg
