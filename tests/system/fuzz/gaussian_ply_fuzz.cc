#include "core/formats/gaussian_ply.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

// Gaussians that can be read can be written, and then read as the same.
PEPESEG_FUZZ_TARGET(gaussian_ply) {
  static pepeseg::fuzz::MemoryFile file, again;
  const auto shape = pepeseg::ReadGaussianPlyShape(file.Put(bytes), "gaussians.ply");
  const auto gaussians = pepeseg::ReadGaussianPly(file.Put(bytes), "gaussians.ply");
  if (!gaussians.ok()) return;
  pepeseg::fuzz::Expect(shape.ok() && shape->count == gaussians->count, "the header's count");
  const auto reread =
      pepeseg::ReadGaussianPly(again.Put(pepeseg::EncodeGaussianPly(*gaussians)), "again.ply");
  pepeseg::fuzz::Expect(reread.ok(), "what was written to be read");
  pepeseg::fuzz::Expect(reread->count == gaussians->count, "as many Gaussians as were written");
}
