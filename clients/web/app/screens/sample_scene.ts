// The sample scene: the shelf that `make demo` trains and leaves on the server.
import type { Scene } from '../../gen/pepeseg/v1/scene_service_pb';

/** Returns whether this is a scene of `make demo`: "demo", or "demo-2" where that was taken. */
export function isSample({ name }: Pick<Scene, 'name'>): boolean {
  return /^scenes\/demo(-\d+)?$/.test(name);
}

/** Returns the first sample that can be opened. */
export function sampleOf(scenes: readonly Scene[]): Scene | undefined {
  return scenes.find((scene) => isSample(scene) && scene.liveModel !== '');
}
