// Ids of scenes and labels from what people type.
/**
 * Makes an id of a scene or a label from a person's text: letters, digits, '_', '.' and '-', beginning
 * with a letter or a digit. A text that is a valid id is not changed.
 */
export function sceneIdFrom(name: string): string {
  const plain = name
    .trim()
    .normalize('NFKD')
    .replace(/[\u0300-\u036f]/g, '')
    .replace(/[^\w.-]+/g, '-')
    .replace(/^[^A-Za-z0-9]+/, '')
    .slice(0, 50)
    .replace(/-+$/, '');
  return plain || 'scene';
}
