#include <cuda_runtime.h>

#include "tests/bench/large_scene.h"

// Photographs of a place on a GPU: one thread a pixel.

namespace pepeseg {
namespace {

constexpr int kBlock = 128;

__global__ void PhotographKernel(SceneSpans scene, SceneCamera camera, uint8_t* bgr,
                                 uint16_t* labels) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= int64_t{camera.width} * camera.height) return;
  PhotographPixel(scene, camera, static_cast<int>(i % camera.width),
                  static_cast<int>(i / camera.width), bgr + 3 * i, labels + i);
}

template <class T>
const T* Upload(const std::vector<T>& values, void*& to) {
  const size_t bytes = values.size() * sizeof(T);
  if (cudaMalloc(&to, bytes) != cudaSuccess) return nullptr;
  if (cudaMemcpy(to, values.data(), bytes, cudaMemcpyHostToDevice) != cudaSuccess) return nullptr;
  return static_cast<const T*>(to);
}

}  // namespace

ScenePhotographer::ScenePhotographer(const LargeScene& scene) : spans_(scene.spans()) {
  spans_.pieces = Upload(scene.pieces(), pieces_);
  spans_.nodes = Upload(scene.nodes(), nodes_);
  spans_.materials = Upload(scene.materials(), materials_);
  ready_ = spans_.pieces != nullptr && spans_.nodes != nullptr && spans_.materials != nullptr;
}

ScenePhotographer::~ScenePhotographer() {
  for (void* buffer : {pieces_, nodes_, materials_}) cudaFree(buffer);
}

ScenePicture ScenePhotographer::Photograph(const SceneCamera& camera) {
  const size_t num_pixels = size_t{1} * camera.width * camera.height;
  ScenePicture out = {std::vector<uint8_t>(3 * num_pixels), std::vector<uint16_t>(num_pixels)};
  uint8_t* bgr = nullptr;
  uint16_t* labels = nullptr;
  ready_ = cudaMalloc(&bgr, 3 * num_pixels) == cudaSuccess &&
           cudaMalloc(&labels, 2 * num_pixels) == cudaSuccess;
  if (ready_) {
    const auto blocks = static_cast<unsigned>((num_pixels + kBlock - 1) / kBlock);
    PhotographKernel<<<blocks, kBlock>>>(spans_, camera, bgr, labels);
    ready_ =
        cudaMemcpy(out.bgr.data(), bgr, 3 * num_pixels, cudaMemcpyDeviceToHost) == cudaSuccess &&
        cudaMemcpy(out.labels.data(), labels, 2 * num_pixels, cudaMemcpyDeviceToHost) ==
            cudaSuccess;
  }
  cudaFree(bgr);
  cudaFree(labels);
  return out;
}

}  // namespace pepeseg
