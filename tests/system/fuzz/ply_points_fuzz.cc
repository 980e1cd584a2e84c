#include "core/formats/ply.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

PEPESEG_FUZZ_TARGET(ply_points) {
  static pepeseg::fuzz::MemoryFile file;
  const auto points = pepeseg::ReadPlyPoints(file.Put(bytes), "points.ply");
  // A vertex takes at least one byte, even as text.
  if (points.ok())
    pepeseg::fuzz::Expect(points->size() <= bytes.size(), "no points out of nothing");
}
