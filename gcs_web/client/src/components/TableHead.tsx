/** The head of a table of figures. */

/** `words`: names of the columns that hold words, not figures. */
export function TableHead({ columns, words }: { columns: readonly string[]; words: readonly string[] }) {
  return (
    <thead>
      <tr>
        {columns.map((name) => (
          <th key={name} scope="col" class={words.includes(name) ? "words" : undefined}>
            {name}
          </th>
        ))}
      </tr>
    </thead>
  );
}
