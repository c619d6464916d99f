using System;

namespace Handcal.Link
{
    /// <summary>Accepts each sequence number once, and none that is 1,024 or more behind.</summary>
    public sealed class ReplayWindow
    {
        const int Size = 1024;
        readonly ulong[] seen = new ulong[Size];  // the number last accepted at each number's place

        /// <summary>The highest number accepted; they start at 1.</summary>
        public ulong Highest { get; private set; }

        /// <summary>Number of accepted datagrams.</summary>
        public ulong Accepted { get; private set; }

        /// <summary>Returns whether a number is new, and remembers it.</summary>
        public bool Accept(ulong sequence)
        {
            if (sequence == 0 || (sequence <= Highest && Highest - sequence >= Size)) return false;
            int place = (int)(sequence % Size);
            if (seen[place] == sequence) return false;
            seen[place] = sequence;
            Highest = Math.Max(Highest, sequence);
            Accepted++;
            return true;
        }
    }
}
