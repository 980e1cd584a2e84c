// Measures a segmentation request of the C++ client, from the call to the mask's pixels, and prints
// the milliseconds of each response. python_mask_bench.py measures the Python client and runs this
// program.
//   pepeseg_mask_bench SERVER FILE REPEATS     FILE: a serialised SegmentViewsRequest
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "clients/cpp/channel.h"
#include "clients/cpp/client.h"
#include "clients/cpp/mask.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg::client {
namespace {

// Returns milliseconds, or < 0 after a failure, which it prints to standard error.
double AskOnce(const Client& client, const v1::SegmentViewsRequest& request) {
  const double start = NowMs();
  const auto answer = client.Segment(request);
  if (!answer.ok() || answer->masks().empty()) {
    std::fprintf(stderr, "%s\n", answer.status().ToString().c_str());
    return -1;
  }
  const auto mask = DecodeRle(answer->masks(0).rle());
  if (!mask.ok() || mask->empty()) {
    std::fprintf(stderr, "%s\n", mask.status().ToString().c_str());
    return -1;
  }
  return NowMs() - start;
}

int Run(const char* server, const char* file, int repeats) {
  v1::SegmentViewsRequest request;
  std::ifstream stream(file, std::ios::binary);
  const auto channel = OpenChannel(server, {});
  if (!request.ParseFromIstream(&stream) || !channel.ok()) return EXIT_FAILURE;
  const Client client(*channel);
  if (AskOnce(client, request) < 0) return EXIT_FAILURE;  // connects
  for (int i = 0; i < repeats; ++i) {
    const double ms = AskOnce(client, request);
    if (ms < 0) return EXIT_FAILURE;
    std::printf("%.4f\n", ms);
  }
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace pepeseg::client

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s SERVER FILE REPEATS\n", argv[0]);
    return 2;
  }
  return pepeseg::client::Run(argv[1], argv[2], std::atoi(argv[3]));
}
