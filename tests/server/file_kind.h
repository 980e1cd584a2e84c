#pragma once

#include "core/dataset/import.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg::testing {

// Returns the kind that a client declares for a file of core's ListDataset.
inline v1::FileKind ToProto(FileKind kind) {
  switch (kind) {
    case FileKind::kImage:
      return v1::FILE_KIND_IMAGE;
    case FileKind::kPoses:
      return v1::FILE_KIND_POSES;
    case FileKind::kMask:
      return v1::FILE_KIND_MASK;
    case FileKind::kIgnoreMask:
      return v1::FILE_KIND_IGNORE_MASK;
    case FileKind::kDepth:
      return v1::FILE_KIND_DEPTH;
    case FileKind::kDisparity:
      return v1::FILE_KIND_DISPARITY;
    case FileKind::kPoints:
      return v1::FILE_KIND_POINTS;
    case FileKind::kGaussians:
      return v1::FILE_KIND_GAUSSIANS;
    case FileKind::kVideo:
      return v1::FILE_KIND_VIDEO;
  }
  return v1::FILE_KIND_UNSPECIFIED;
}

}  // namespace pepeseg::testing
