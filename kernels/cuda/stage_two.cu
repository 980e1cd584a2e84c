#include "kernels/cuda/cuda_backend.h"

// The steps of stage two are not on CUDA yet: asking for one is an error, never a silent nothing.

namespace pepeseg {

void CudaBackend::FeatureRows(const FeatureRowsArgs&) {
  Fail("FeatureRows is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::PairLoss(const PairLossArgs&) {
  Fail("PairLoss is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::FeatureRowsBackward(const FeatureRowsBackwardArgs&) {
  Fail("FeatureRowsBackward is not on CUDA yet: train the features on the CPU");
}
void CudaBackend::FeatureUpdate(const FeatureUpdateArgs&) {
  Fail("FeatureUpdate is not on CUDA yet: train the features on the CPU");
}

}  // namespace pepeseg
