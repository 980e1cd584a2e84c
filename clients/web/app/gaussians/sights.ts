import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { SightOfPhotograph } from './floaters';

/** Returns what the views' cameras see. Views without a camera are left out. */
export function sightsOf(views: readonly View[]): SightOfPhotograph[] {
  return views.flatMap(({ camera, camFromWorld }) => {
    const { rotation, translation: t } = camFromWorld ?? {};
    if (!camera || !rotation || !t || camera.fx <= 0 || camera.fy <= 0) return [];
    const length = Math.hypot(rotation.w, rotation.x, rotation.y, rotation.z) || 1;
    const [w, x, y, z] = [rotation.w, rotation.x, rotation.y, rotation.z].map(
      (part) => part / length,
    ) as [number, number, number, number];
    return {
      camFromWorld: [
        ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), t.x],
        ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), t.y],
        ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), t.z],
      ],
      across: camera.width / (2 * camera.fx),
      up: camera.height / (2 * camera.fy),
    };
  });
}
