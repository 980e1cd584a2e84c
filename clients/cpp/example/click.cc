// Segments the object under a pixel, and prints the area of its mask in every view of the scene.
//   click SERVER SCENE VIEW X Y
#include <cstdio>
#include <cstdlib>
#include <iostream>

#include "clients/cpp/channel.h"
#include "clients/cpp/client.h"
#include "clients/cpp/resource_names.h"

using pepeseg::client::Client;
namespace v1 = pepeseg::v1;

int main(int argc, char** argv) {
  if (argc != 6) {
    std::fprintf(stderr, "usage: %s SERVER SCENE VIEW X Y\n", argv[0]);
    return 2;
  }
  const auto channel = pepeseg::client::OpenChannel(argv[1], {});
  if (!channel.ok()) {
    std::cerr << channel.status() << "\n";
    return 1;
  }
  v1::SegmentViewsRequest request;
  request.set_model(pepeseg::client::ModelName(argv[2]));
  request.mutable_prompt()->mutable_view()->set_view(argv[3]);
  auto* point = request.mutable_prompt()->mutable_points()->add_points();
  point->set_x(std::atof(argv[4]));
  point->set_y(std::atof(argv[5]));
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  const auto answer = Client(*channel).Segment(request);
  if (!answer.ok()) {
    std::cerr << answer.status() << "\n";
    return 1;
  }
  for (const auto& mask : answer->masks()) {
    std::cout << mask.view() << ": " << mask.area() << " pixels\n";
  }
}
