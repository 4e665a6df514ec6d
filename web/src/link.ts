// The whole set-up in the address: what stands after the # never leaves the browser.

/** What a link carries. */
export interface Shared {
  toml: string;
  robots: string[];
}

const VERSION = "1";
/** A set-up is a few kilobytes; more is not one. */
const MOST_CHARACTERS = 200_000;
/** Unpacked: a small link may expand to a thousand times its size. */
const MOST_BYTES = 2_000_000;

/** Breaks off what is longer than a set-up. */
function limited(): TransformStream<Uint8Array<ArrayBuffer>, Uint8Array<ArrayBuffer>> {
  let length = 0;
  return new TransformStream({
    transform(chunk, controller) {
      length += chunk.length;
      if (length > MOST_BYTES) controller.error(new Error(`more than ${MOST_BYTES} bytes`));
      else controller.enqueue(chunk);
    },
  });
}

async function piped(bytes: Uint8Array<ArrayBuffer>, through: CompressionStream | DecompressionStream): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(through).pipeThrough(limited());
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Throws where `decode` would refuse the link. */
export async function encode(shared: Shared): Promise<string> {
  const bytes = new TextEncoder().encode(JSON.stringify(shared));
  if (bytes.length > MOST_BYTES) throw tooLarge(bytes.length, MOST_BYTES, "bytes");
  const packed = await piped(bytes, new CompressionStream("deflate-raw"));
  const binary = Array.from(packed, (byte) => String.fromCharCode(byte)).join("");
  const text = btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
  if (text.length > MOST_CHARACTERS) throw tooLarge(text.length, MOST_CHARACTERS, "characters");
  return `${VERSION}.${text}`;
}

function tooLarge(size: number, most: number, unit: string): Error {
  return new Error(`the set-up is too large for a link: ${size} ${unit}, at most ${most}; Save TOML keeps it in a file`);
}

/** Reads what `encode` wrote. Throws with a reason. */
export async function decode(fragment: string): Promise<Shared> {
  const broken = "the link does not hold a set-up: it is cut off or was changed";
  const [version, text, ...rest] = fragment.split(".");
  if (version !== VERSION || text === undefined || rest.length > 0 || text.length > MOST_CHARACTERS) throw new Error(broken);
  try {
    const binary = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = Uint8Array.from(binary, (character) => character.charCodeAt(0));
    const json = new TextDecoder().decode(await piped(bytes, new DecompressionStream("deflate-raw")));
    const { toml, robots } = JSON.parse(json) as Partial<Shared>;
    if (typeof toml !== "string" || !Array.isArray(robots) || !robots.every((name) => typeof name === "string")) {
      throw new Error(broken);
    }
    return { toml, robots };
  } catch {
    throw new Error(broken);
  }
}
